//! The arm controller's logic: no hardware, no clock of its own.
#![no_std]
