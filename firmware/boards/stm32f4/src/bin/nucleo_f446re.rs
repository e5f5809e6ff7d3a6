//! The image of the NUCLEO-F446RE.
#![no_std]
#![no_main]

#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    gonia_stm32f4::run(&gonia_pins::boards::NUCLEO_F446RE).await
}
