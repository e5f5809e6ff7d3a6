//! What a bootloader leaves on, before the program has its memory.
//!
//! One that reads SD cards or speaks USB jumps here with its timer and its interrupts running, and the first of
//! them would find no handler that knows it. So: SysTick off, every interrupt of the NVIC off and none pending,
//! SysTick's too. The runtime calls this after it has set stack and vector table, and before it clears memory.

core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\", %progbits",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "cpsid i",
    // SYST_CSR
    "ldr r0, =0xE000E010",
    "movs r1, #0",
    "str r1, [r0]",
    // NVIC_ICER and, 0x100 behind it, NVIC_ICPR: eight words each.
    "ldr r0, =0xE000E180",
    "mvns r1, r1",
    "movs r2, #8",
    "1:",
    "str r1, [r0]",
    "str r1, [r0, #0x100]",
    "adds r0, #4",
    "subs r2, #1",
    "bne 1b",
    // ICSR: PENDSTCLR
    "ldr r0, =0xE000ED04",
    "ldr r1, =0x02000000",
    "str r1, [r0]",
    "cpsie i",
    "bx lr",
    ".ltorg",
);
