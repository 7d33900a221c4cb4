/* The computed time of function blocks (CTRL_CYCLE_TIME) for values of the header page. No image is mapped. */
#include <stdio.h>
#include "iec_std_lib.h"
#include "commram_matiec.h"
COMMRAM_MATIEC_STORAGE

static uint64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/* The computed time if emulated time 0 was `ago_ms` before now. */
static unsigned long exact(uint64_t ago_ms, uint64_t speed, uint64_t virtual_time_us)
{
    commram_header *header = commram_matiec_header();
    COMMRAM_STORE(header->virtual_time_us, virtual_time_us);
    COMMRAM_STORE(header->speed, speed);
    COMMRAM_STORE(header->real_epoch_ns, now_ns() - ago_ms * 1000000u);
    return commram_matiec_exact_us();
}

int main(void)
{
    unsigned long time;
    printf("stepped %lu\n", exact(5000, 0, 1000000));
    printf("late %lu\n", exact(5000, 1000, 1000000));
    printf("fast %lu\n", exact(5000, 4000, 19900000));
    printf("ahead %lu\n", exact(5000, 1000, 3600000000u));
    /* The limits of the check allow a slow machine up to 40 ms for these lines. */
    time = exact(1050, 1000, 1000000);
    printf("between %d\n", time >= 1050000 && time < 1100000);
    return 0;
}
