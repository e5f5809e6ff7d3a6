//! The image of the BIGTREETECH Octopus.
#![no_std]
#![no_main]

#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    gonia_stm32f4::run(&gonia_pins::boards::BTT_OCTOPUS).await
}
