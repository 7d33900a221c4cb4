 *
 * The program around a program that matiec compiled: it maps the registers under the located variables, and scans.
 *
 *     plc IMAGE [EVENT [I_PAR1]]
 *
 * IMAGE    for example /dev/shm/commram.default.line
 * EVENT    number of the event that each scan waits for; without it a scan comes each time the interval of the
 *          program's task is over, by the clock of this computer, which suits an emulator in real time
 * I_PAR1   enables the event with INTR_SET first: of a CPU timer, events 0 and 2, the factor of 50 us
 *
 * In stepped mode emulated time waits for each scan of an event (lockstep). TON and the like count emulated time. The
 * board's switch and supply start and stop the program (docs/board.md); a cold or warm start gives all variables
 * their initial values, also retained ones. It ends by SIGINT and SIGTERM.
 *
 * Exit code: 0 ended by a signal, 1 the emulator is gone or has refused something, 2 wrong use or not attached.
 */
#include <signal.h>

#include "iec_std_lib.h"
#include "commram_matiec.h"
#include "POUS.h"

COMMRAM_MATIEC_STORAGE
#include "commram_located.h"

/* How long the emulator may really take for an answer, and how often a wait looks for signals. */
#define ANSWER_MS 5000u
#define SLICE_MS 100u

/* What matiec's code wants of its runtime, and gives to it. */
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
extern unsigned long long common_ticktime__;
void config_init__(void);
void config_run__(unsigned long tick);

static volatile sig_atomic_t ended;

static void on_signal(int number)
{
    (void)number;
    ended = 1;
}

static int failed(const char *what, commram_result result)
{
    fprintf(stderr, "%s: %s\n", what, commram_text(result));
    return 1;
}

/* Sleeps until it is time for the scan at `due`, in which a signal is noticed, and counts `due` on. */
static void sleep_until(struct timespec *due)
{
    while (!ended && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, due, NULL) == EINTR)
        ;
    due->tv_nsec += (long)(common_ticktime__ % 1000000000u);
    due->tv_sec += (time_t)(common_ticktime__ / 1000000000u) + due->tv_nsec / 1000000000;
    due->tv_nsec %= 1000000000;
}

/* A cold or warm start of the program. */
static commram_result begin(commram_plc *plc, const char *image, const char *event, const char *par1)
{
    commram_result result;
    commram_tell(plc, COMMRAM_PROGRAM_STATE_INITIALIZING);
    result = commram_matiec_start(plc->ram, image, config_init__);
    if (result == COMMRAM_DONE && par1) {
        result = commram_intr_set(plc->ram, (uint32_t)strtoul(event, NULL, 0), 1,
                                  (uint16_t)strtoul(par1, NULL, 0), ANSWER_MS);
        if (result != COMMRAM_DONE)
            failed("INTR_SET", result);
    }
    if (result == COMMRAM_DONE)
        commram_tell(plc, COMMRAM_PROGRAM_STATE_CYCLIC);
    return result;
}

/* Does what the board orders. */
static commram_result obey(commram_plc *plc, const char *image, const char *event, const char *par1)
{
    commram_result result = commram_check(plc->ram);
    if (result != COMMRAM_DONE)
        return result;
    switch (commram_order(plc)) {
    case COMMRAM_START_COLD:
    case COMMRAM_START_WARM:
        return begin(plc, image, event, par1);
    case COMMRAM_START_HOT:
        commram_tell(plc, COMMRAM_PROGRAM_STATE_CYCLIC);
        break;
    case COMMRAM_START_STOP:
        commram_tell(plc, COMMRAM_PROGRAM_STATE_STOPPED);
        break;
    default:
        break;
    }
    return COMMRAM_DONE;
}

static void scan(commram *ram, unsigned long tick)
{
    COMMRAM_MATIEC_TIME(ram, __CURRENT_TIME);
    config_run__(tick);
    commram_ring(ram);
}

int main(int argc, char **argv)
{
    const char *image = argc > 1 ? argv[1] : NULL, *number = argc > 2 ? argv[2] : NULL;
    const char *par1 = argc > 3 ? argv[3] : NULL;
    struct sigaction action;
    struct timespec due;
    commram ram;
    commram_plc plc;
    commram_task task;
    commram_result result;
    uint32_t event, seen = 0;
    unsigned long tick = 0;
    int stepped;
    event = number ? (uint32_t)strtoul(number, NULL, 0) : 0;
    if (argc < 2 || argc > 4 || event >= sizeof ram.header->events / sizeof ram.header->events[0]) {
        fprintf(stderr, "usage: plc IMAGE [EVENT [I_PAR1]]\n");
        return 2;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);

    memset(&task, 0, sizeof task);
    memset(&ram, 0, sizeof ram);
    result = commram_matiec_start(&ram, image, config_init__);
    if (result != COMMRAM_DONE) {
        failed(image, result);
        return 2;
    }
    stepped = number && COMMRAM_LOAD(ram.header->clock_mode) == COMMRAM_CLOCK_MODE_STEPPED;
    if (stepped) {
        result = commram_join(&ram, &task, event, ANSWER_MS, ANSWER_MS);
        if (result != COMMRAM_DONE)
            return failed("lockstep", result);
    } else {
        seen = commram_event_count(&ram, event);
    }
    result = commram_load(&plc, &ram);
    clock_gettime(CLOCK_MONOTONIC, &due);

    while (!ended && result == COMMRAM_DONE) {
        int is_due = 1;
        result = obey(&plc, image, number, par1);
        if (result != COMMRAM_DONE)
            break;
        if (stepped)
            result = commram_turn(&task, SLICE_MS);
        else if (number)
            result = commram_await_event(&ram, event, &seen, SLICE_MS);
        else
            sleep_until(&due);
        if (result == COMMRAM_TIMEOUT) {
            is_due = 0;
            result = COMMRAM_DONE;
        }
        if (is_due && result == COMMRAM_DONE && plc.runs)
            scan(&ram, tick++);
        if (is_due && result == COMMRAM_DONE && stepped)
            commram_done(&task);
    }
    if (result != COMMRAM_DONE)
        return failed(image, result);
    if (stepped)
        commram_leave(&task);
    commram_unload(&plc);
    commram_matiec_detach(&ram);
    return 0;
}
