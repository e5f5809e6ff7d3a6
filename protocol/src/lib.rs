//! All that travels on the wire. No I/O.
#![no_std]
