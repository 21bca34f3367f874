/*
 * Replays recorded frames through the ECU on a Cortex-M4F, over semihosting: for QEMU and for a debugger.
 *
 * Reads `frames.bin`: records of 24 bytes (kind, length, two bytes unused, identifier, data, time in ns); kind 0 is a frame for
 * the ECU, kind 1 a tick, kind 2 a start anew. Writes `answers.bin`: for each tick a record of 16 bytes (0xFFFFFFFF, number of frames, instructions,
 * 0), then one of 16 bytes for each frame (identifier, length and three bytes unused, data). Then the depth of the stack.
 *
 * Instructions are counted by SysTick: under `-icount shift=0` QEMU takes 1 ns for each, and one count at 25 MHz is 40 of them.
 */
#include <string.h>

#include "ecu.h"

#define SYS_OPEN 1U
#define SYS_CLOSE 2U
#define SYS_WRITE 5U
#define SYS_READ 6U
#define SYS_EXIT 0x18U
#define READ_BINARY 1U
#define WRITE_BINARY 5U
#define RECORD 24U
#define TICK 1U
#define START 2U
#define ANSWER 16U
#define RECORDS 128U
#define INSTRUCTIONS_PER_COUNT 40U
#define EXIT_WELL 0x20026U
#define TICK_MARK 0xFFFFFFFFU
#define SYST_CSR (*(volatile uint32_t *)0xE000E010U)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014U)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018U)
#define LONGEST_COUNT 0xFFFFFFU
#define STACK_PATTERN 0xA5A5A5A5U

extern uint32_t bss_end, stack_top;

static uint8_t records[RECORDS * RECORD];
static EcuFrame answers[ECU_MOST_FRAMES];

static uint32_t semihosted(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static uint32_t opened(const char *name, uint32_t mode)
{
    const uint32_t block[3] = {(uint32_t)name, mode, (uint32_t)strlen(name)};
    return semihosted(SYS_OPEN, block);
}

static void written(uint32_t file, const void *bytes, uint32_t length)
{
    const uint32_t block[3] = {file, (uint32_t)bytes, length};
    (void)semihosted(SYS_WRITE, block);
}

static uint32_t read_into(uint32_t file, void *bytes, uint32_t length)
{
    const uint32_t block[3] = {file, (uint32_t)bytes, length};
    return length - semihosted(SYS_READ, block);
}

static void ticked(uint32_t file, int64_t now_ns)
{
    const uint32_t before = SYST_CVR;
    const uint8_t count = ecu_tick(now_ns, answers);
    const uint32_t passed = (before - SYST_CVR) & LONGEST_COUNT; /* it counts down */
    const uint32_t mark[4] = {TICK_MARK, count, passed * INSTRUCTIONS_PER_COUNT, 0U};
    written(file, mark, sizeof mark);
    for (uint8_t k = 0U; k < count; ++k) {
        uint8_t answer[ANSWER] = {0};
        (void)memcpy(&answer[0], &answers[k].id, 4U);
        answer[4] = answers[k].length;
        (void)memcpy(&answer[8], answers[k].data, 8U);
        written(file, answer, ANSWER);
    }
}

static void started(void)
{
    ecu_init(true);
#ifdef REPLAY_DETECTS_FAULTS
    ecu_detect_faults(true);
#endif
}

static void replayed(uint32_t in, uint32_t out)
{
    uint32_t got = read_into(in, records, sizeof records);
    while (got >= RECORD) {
        for (uint32_t at = 0U; (at + RECORD) <= got; at += RECORD) {
            uint32_t id;
            int64_t now_ns;
            (void)memcpy(&id, &records[at + 4U], sizeof id);
            (void)memcpy(&now_ns, &records[at + 16U], sizeof now_ns);
            if (records[at] == TICK) {
                ticked(out, now_ns);
            } else if (records[at] == START) {
                started();
            } else {
                ecu_receive(id, &records[at + 8U], records[at + 1U], now_ns);
            }
        }
        got = read_into(in, records, sizeof records);
    }
}

int main(void)
{
    const uint32_t in = opened("frames.bin", READ_BINARY);
    const uint32_t out = opened("answers.bin", WRITE_BINARY);
    SYST_RVR = LONGEST_COUNT;
    SYST_CVR = 0U;
    SYST_CSR = 5U; /* counts the processor's clock, without interrupt */
    started();
    replayed(in, out);
    const uint32_t *untouched = &bss_end;
    while (*untouched == STACK_PATTERN) {
        ++untouched;
    }
    const uint32_t depth = (uint32_t)&stack_top - (uint32_t)untouched;
    const uint32_t end[4] = {TICK_MARK, TICK_MARK, depth, 0U};
    written(out, end, sizeof end);
    (void)semihosted(SYS_CLOSE, &out);
    (void)semihosted(SYS_EXIT, (const void *)EXIT_WELL);
    return 0;
}
