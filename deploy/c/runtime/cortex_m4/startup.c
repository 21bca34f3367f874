/* Start of a Cortex-M4F without an operating system: vectors, memory, floating-point unit, then main(). */
#include <stdint.h>

extern uint32_t stack_top, data_load, data_start, data_end, bss_start, bss_end;
extern int main(void);
void reset_handler(void);
void stopped(void);

#define CPACR (*(volatile uint32_t *)0xE000ED88U)
#define STACK_PATTERN 0xA5A5A5A5U

void stopped(void)
{
    for (;;) {
        /* a fault: the debugger or the watchdog takes over */
    }
}

void reset_handler(void)
{
    CPACR |= 0xFU << 20; /* access to the floating-point unit, before any register of it is used */
    __asm__ volatile("dsb\n isb");
    const uint32_t *from = &data_load;
    for (uint32_t *to = &data_start; (uintptr_t)to < (uintptr_t)&data_end; ++to) {
        *to = *from;
        ++from;
    }
    for (uint32_t *to = &bss_start; (uintptr_t)to < (uintptr_t)&bss_end; ++to) {
        *to = 0U;
    }
    /* the free memory gets a pattern, so that the depth of the stack can be seen afterwards */
    uintptr_t here;
    __asm__ volatile("mov %0, sp" : "=r"(here));
    for (uint32_t *to = &bss_end; (uintptr_t)to < (here - 64U); ++to) {
        *to = STACK_PATTERN;
    }
    (void)main();
    stopped();
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, (const void *)reset_handler, (const void *)stopped, (const void *)stopped,
    (const void *)stopped, (const void *)stopped, (const void *)stopped, 0,
    0, 0, 0, (const void *)stopped,
    (const void *)stopped, 0, (const void *)stopped, (const void *)stopped,
};
