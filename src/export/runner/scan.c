/* Longest real time for an answer of the emulator, and interval at which a wait checks for signals. */
#define ANSWER_MS 5000u
#define SLICE_MS 100u
/* Emulated time in microseconds without the event of the scans, after which scans begin without the event. */
#define MISSING_US 100000u
/* Interval at which a program in real time checks whether its event is missing. */
#define LOOK_MS 5u
/* Time for which a program must be stopped before it prints the reason. */
#define STOPPED_SECONDS 2

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

/* Sleeps until `due`, the time of the next scan, or until a signal arrives. Advances `due` by one interval. */
static void sleep_until(struct timespec *due)
{
    while (!ended && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, due, NULL) == EINTR)
        ;
    due->tv_nsec += (long)(common_ticktime__ % 1000000000u);
    due->tv_sec += (time_t)(common_ticktime__ / 1000000000u) + due->tv_nsec / 1000000000;
    due->tv_nsec %= 1000000000;
}

/* A cold or warm start of the program. */
static commram_result begin(commram_plc *plc, uint32_t kind, const char *image, const char *event, const char *par1)
{
    commram_result result;
    commram_tell(plc, COMMRAM_PROGRAM_STATE_INITIALIZING);
    result = commram_matiec_begin(plc->ram, image, config_init__, kind);
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
    uint32_t order;
    if (result != COMMRAM_DONE)
        return result;
    order = commram_order(plc);
    switch (order) {
    case COMMRAM_START_COLD:
    case COMMRAM_START_WARM:
        return begin(plc, order, image, event, par1);
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

/* Prints the reason why the program is stopped, once for each stop that lasts a while. */
static void say_stopped(const commram_plc *plc)
{
    static time_t since;
    static int is_said;
    time_t now = time(NULL);
    if (plc->runs || !since) {
        since = now;
        is_said = 0;
    } else if (!is_said && now - since >= STOPPED_SECONDS) {
        is_said = 1;
        fprintf(stderr, "%s\n", commram_stopped_because(plc->ram));
    }
}

/* The scans of a program that waits for an event. */
typedef struct pace {
    uint64_t period_us; /* of a CPU timer */
    uint64_t last_us;  /* emulated time of the last scan or start */
    int is_missing;    /* the last scan came without the event */
} pace;

/* Interval of the program's task in microseconds, at least 1. */
static uint64_t interval_us(void)
{
    uint64_t us = common_ticktime__ / 1000u;
    return us ? us : 1;
}

/* Returns the time after the last scan at which a scan begins without the event. */
static uint64_t patience_us(const pace *pace)
{
    uint64_t interval = interval_us();
    if (pace->is_missing)
        return interval;
    interval = interval > pace->period_us ? interval : pace->period_us;
    return 2 * interval > MISSING_US ? 2 * interval : MISSING_US;
}

/* Returns 1 if a scan is due, because the event has occurred or has been missing for long enough. */
static int is_due_at(pace *pace, uint64_t now_us, int has_come)
{
    int is_late = now_us - pace->last_us >= patience_us(pace);
    if (!has_come && !is_late)
        return 0;
    pace->last_us = now_us;
    pace->is_missing = !has_come;
    return 1;
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
    uint32_t event, seen;
    unsigned long tick = 0;
    int stepped, ran = 0;
    pace pace = {0, 0, 0};
    event = number ? (uint32_t)strtoul(number, NULL, 0) : 0;
    pace.period_us = par1 ? 50u * strtoul(par1, NULL, 0) : 0;
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
    result = commram_matiec_flags(&ram, ANSWER_MS);
    if (result == COMMRAM_REFUSED)
        fprintf(stderr, "retain flags keep what they hold: this device gives them no initial values, or has fewer of them\n");
    else if (result != COMMRAM_DONE)
        return failed("initial values of retain flags", result);
    stepped = number && COMMRAM_LOAD(ram.header->clock_mode) == COMMRAM_CLOCK_MODE_STEPPED;
    seen = commram_event_count(&ram, event);
    if (stepped) {
        result = commram_join(&ram, &task, event | COMMRAM_SEAT_ORDERS, ANSWER_MS, ANSWER_MS);
        if (result != COMMRAM_DONE)
            return failed("lockstep", result);
    }
    result = commram_load(&plc, &ram);
    clock_gettime(CLOCK_MONOTONIC, &due);

    while (!ended && result == COMMRAM_DONE) {
        int is_due = 1, has_turn = 0;
        if (stepped) {
            result = commram_turn(&task, SLICE_MS);
            has_turn = result == COMMRAM_DONE;
        } else if (number) {
            result = commram_await_event(&ram, event, &seen, plc.runs ? LOOK_MS : SLICE_MS);
        } else {
            sleep_until(&due);
        }
        if (result == COMMRAM_TIMEOUT) {
            is_due = 0;
            result = COMMRAM_DONE;
        }
        /*
         * Asks for orders between the wait and the scan: an order that came during the wait concerns this scan. In
         * lockstep, each order has its own turn.
         */
        if (result == COMMRAM_DONE && (has_turn || !stepped))
            result = obey(&plc, image, number, par1);
        if (has_turn) {
            uint32_t count = commram_event_count(&ram, event);
            is_due = count != seen;
            seen = count;
        }
        if (number && (has_turn || !stepped)) {
            uint64_t now_us = COMMRAM_LOAD(ram.header->virtual_time_us);
            if (plc.runs != ran) {
                pace.last_us = now_us;
                pace.is_missing = 0;
            }
            ran = plc.runs;
            is_due = plc.runs && is_due_at(&pace, now_us, is_due);
        }
        if (is_due && result == COMMRAM_DONE && plc.runs)
            scan(&ram, tick++);
        if (has_turn && plc.runs)
            commram_done_for(&task, (uint32_t)patience_us(&pace));
        else if (has_turn)
            commram_done(&task);
        if (result == COMMRAM_DONE)
            say_stopped(&plc);
    }
    if (result != COMMRAM_DONE)
        return failed(image, result);
    if (stepped)
        commram_leave(&task);
    commram_unload(&plc);
    commram_matiec_detach(&ram);
    return 0;
}
