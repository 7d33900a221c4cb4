
/* Notifies the board of a request in the header page. Every function that stores such a request calls it at its end. */
static inline commram_result commram_request(commram *ram)
{
    if (!ram->writable)
        return COMMRAM_READ_ONLY;
    COMMRAM_ADD(ram->header->board_requests, 1);
    return commram_ring(ram);
}

/* A cell of the header page, and the value for which commram_wait_until waits. */
typedef struct commram_expected {
    COMMRAM_CELL(uint32_t) *cell;
    uint32_t value;
    int wanted; /* 1: until it has the value, 0: until it has another one */
} commram_expected;

static inline int commram_is_expected(const commram *ram, void *context)
{
    const commram_expected *expected = (const commram_expected *)context;
    (void)ram;
    return (COMMRAM_LOAD(*expected->cell) == expected->value) == expected->wanted;
}

/*
 * Function block INTR_SET: enables (`enable` 1) or disables (0) an event; `par1` is the factor of a CPU timer. If it
 * returns COMMRAM_REFUSED, header->interrupts[event].result has the reason (COMMRAM_INTERRUPT_RESULT_...).
 */
static inline commram_result
commram_intr_set(commram *ram, uint32_t event, int enable, uint16_t par1, uint32_t timeout_ms)
{
    commram_interrupt *slot;
    commram_expected answered;
    commram_result result;
    uint32_t number;
    if (event >= sizeof ram->header->interrupts / sizeof ram->header->interrupts[0])
        return COMMRAM_REFUSED;
    slot = &ram->header->interrupts[event];
    number = ((COMMRAM_LOAD(slot->answer) >> 1) + 1u) & 0x7FFFu;
    answered.cell = &slot->answer;
    answered.value = (uint32_t)par1 << 16 | number << 1 | (enable ? 1u : 0u);
    answered.wanted = 1;
    if (!ram->writable)
        return COMMRAM_READ_ONLY;
    COMMRAM_STORE(slot->request, answered.value);
    commram_request(ram);
    result = commram_wait_until(ram, commram_is_expected, &answered, timeout_ms);
    if (result != COMMRAM_DONE)
        return result;
    return COMMRAM_LOAD(slot->result) == COMMRAM_INTERRUPT_RESULT_DONE ? COMMRAM_DONE : COMMRAM_REFUSED;
}

/* Waits until `bell` has rung more than `seen` times. */
static inline commram_result commram_wait_ring(commram *ram, commram_bell *bell, uint32_t seen, uint32_t timeout_ms)
{
    uint64_t end = commram_now_ms() + timeout_ms;
    while (COMMRAM_LOAD(bell->word) == seen) {
        commram_result result = commram_check(ram);
        if (result != COMMRAM_DONE)
            return result;
        if (commram_now_ms() >= end)
            return COMMRAM_TIMEOUT;
        commram_sleep(ram, bell, seen);
    }
    return COMMRAM_DONE;
}

/* How often an event has come. */
static inline uint32_t commram_event_count(const commram *ram, uint32_t event)
{
    return COMMRAM_LOAD(ram->header->events[event].bell.word);
}

/*
 * Waits until the event has occurred more than `*seen` times, and sets `*seen` to the number of occurrences. If the
 * number has increased by more than 1, the program has missed events. Begin with the result of commram_event_count.
 */
static inline commram_result commram_await_event(commram *ram, uint32_t event, uint32_t *seen, uint32_t timeout_ms)
{
    commram_result result = commram_wait_ring(ram, &ram->header->events[event].bell, *seen, timeout_ms);
    if (result == COMMRAM_DONE)
        *seen = commram_event_count(ram, event);
    return result;
}

/*
 * Flag for the `event` of commram_join. With this flag, the task has a turn at once, and whenever the board orders a
 * start or stop of the program or has been reset, even if the event does not occur. Use commram_event_count to find out
 * whether the event has occurred.
 */
#define COMMRAM_SEAT_ORDERS 0x100u

/*
 * Flag for the run time at the end of a turn. With this flag, the task is done. The other bits of the run time are the
 * longest emulated time in microseconds until its next turn, which comes even if the event does not occur.
 */
#define COMMRAM_SEAT_WAITS 0x80000000u

/* A task for which the emulated time waits (lockstep, stepped mode only). */
typedef struct commram_task {
    commram *ram;
    commram_seat *seat;
    uint32_t turns; /* that it has had */
} commram_task;

/*
 * Takes a seat for a task of `event`. `patience_ms` is the longest real time of a turn. After this time the emulator no
 * longer waits for the task. With 0, the emulator waits as long as the process lives.
 */
static inline commram_result
commram_join(commram *ram, commram_task *task, uint32_t event, uint32_t patience_ms, uint32_t timeout_ms)
{
    size_t i;
    if (!ram->writable)
        return COMMRAM_READ_ONLY;
    for (i = 0; i < sizeof ram->header->lockstep / sizeof ram->header->lockstep[0]; i++) {
        commram_seat *seat = &ram->header->lockstep[i];
        commram_expected asked;
        commram_result result;
        uint32_t free_seat = 0;
        if (!COMMRAM_SWAP_IF(seat->owner, &free_seat, (uint32_t)getpid()))
            continue;
        task->ram = ram;
        task->seat = seat;
        task->turns = COMMRAM_LOAD(seat->turn.word);
        COMMRAM_STORE(seat->owner_start, commram_process_start((uint32_t)getpid()));
        COMMRAM_STORE(seat->event, event);
        COMMRAM_STORE(seat->patience_ms, patience_ms);
        COMMRAM_STORE(seat->run_us, 0);
        COMMRAM_STORE(seat->state, COMMRAM_SEAT_STATE_ASKING);
        commram_request(ram);
        asked.cell = &seat->state;
        asked.value = COMMRAM_SEAT_STATE_ASKING;
        asked.wanted = 0;
        result = commram_wait_until(ram, commram_is_expected, &asked, timeout_ms);
        if (result == COMMRAM_DONE && COMMRAM_LOAD(seat->state) == COMMRAM_SEAT_STATE_SEATED)
            return COMMRAM_DONE;
        COMMRAM_STORE(seat->state, COMMRAM_SEAT_STATE_FREE);
        COMMRAM_STORE(seat->owner, 0);
        commram_request(ram);
        return result == COMMRAM_DONE ? COMMRAM_REFUSED : result;
    }
    return COMMRAM_NO_SEAT;
}

/*
 * Waits for the task's turn. During the turn, which commram_done ends, the emulated time header->virtual_time_us does
 * not advance.
 */
static inline commram_result commram_turn(commram_task *task, uint32_t timeout_ms)
{
    commram_result result = commram_wait_ring(task->ram, &task->seat->turn, task->turns, timeout_ms);
    if (result != COMMRAM_DONE)
        return result;
    if (COMMRAM_LOAD(task->seat->state) != COMMRAM_SEAT_STATE_SEATED)
        return COMMRAM_LOST;
    task->turns++;
    return COMMRAM_DONE;
}

static inline void commram_end_turn(commram_task *task, uint32_t run_us)
{
    commram_bell *done = &task->seat->done;
    COMMRAM_STORE(task->seat->run_us, run_us);
    COMMRAM_ADD(done->word, 1);
    if (COMMRAM_LOAD(done->waiters))
        commram_system(SYS_futex, (uint32_t *)&done->word, FUTEX_WAKE, INT_MAX, NULL, NULL, 0);
}

/* Ends the turn. The next turn begins at the next event of the task. */
static inline void commram_done(commram_task *task)
{
    commram_end_turn(task, 0);
}

/*
 * Ends the turn. The next turn begins at the next event, or after `us` microseconds of emulated time if no event occurs
 * before. `us` must not be 0.
 */
static inline void commram_done_for(commram_task *task, uint32_t us)
{
    commram_end_turn(task, COMMRAM_SEAT_WAITS | (us < COMMRAM_SEAT_WAITS ? us : COMMRAM_SEAT_WAITS - 1u));
}

/*
 * Advances the emulated time by `run_us` microseconds, the run time of the task, and waits for the task's next turn.
 * `run_us` must not be 0. Store outputs after this call.
 */
static inline commram_result commram_run(commram_task *task, uint32_t run_us, uint32_t timeout_ms)
{
    commram_end_turn(task, run_us);
    return commram_turn(task, timeout_ms);
}

/* Gives the seat back. */
static inline void commram_leave(commram_task *task)
{
    COMMRAM_STORE(task->seat->state, COMMRAM_SEAT_STATE_FREE);
    COMMRAM_STORE(task->seat->owner, 0);
    commram_request(task->ram);
}

/* A program that the board starts and stops. */
typedef struct commram_plc {
    commram *ram;
    uint32_t orders;   /* of the board, seen so far */
    uint32_t restarts; /* power-ons and resets, seen so far */
    int runs;
} commram_plc;

/* Reports the state of the program to the board: COMMRAM_PROGRAM_STATE_INITIALIZING, _CYCLIC or _STOPPED. */
static inline void commram_tell(commram_plc *plc, uint32_t state)
{
    commram_program *program = &plc->ram->header->program;
    uint32_t now = COMMRAM_LOAD(program->state);
    /* The state NONE (0) means that the board has lost the project. It must not change until a project is loaded. */
    while (now != COMMRAM_PROGRAM_STATE_NONE && !COMMRAM_SWAP_IF(program->state, &now, state))
        ;
    plc->runs = state == COMMRAM_PROGRAM_STATE_CYCLIC || state == COMMRAM_PROGRAM_STATE_INITIALIZING;
    commram_request(plc->ram);
}

/*
 * Loads the program. The program does not run until the board orders a start. If the switch is at RUN, the board orders
 * it soon.
 */
static inline commram_result commram_load(commram_plc *plc, commram *ram)
{
    commram_program *program = &ram->header->program;
    uint32_t state = COMMRAM_LOAD(program->state), kind = COMMRAM_LOAD(program->start_kind);
    if (!ram->writable)
        return COMMRAM_READ_ONLY;
    plc->ram = ram;
    plc->orders = COMMRAM_LOAD(program->start.word);
    plc->restarts = COMMRAM_LOAD(program->restarts);
    plc->runs = 0;
    if (state == COMMRAM_PROGRAM_STATE_STOPPED) {
        /*
         * The board may have ordered a start before the program was loaded. The next call of commram_order must return
         * this order.
         */
        if (kind >= COMMRAM_START_COLD && kind <= COMMRAM_START_HOT)
            plc->orders--;
    } else if (state != COMMRAM_PROGRAM_STATE_NONE || COMMRAM_LOAD(ram->header->project) != COMMRAM_PROJECT_NONE) {
        COMMRAM_STORE(program->start_request, COMMRAM_START_COLD);
    }
    COMMRAM_STORE(program->state, COMMRAM_PROGRAM_STATE_STOPPED);
    return commram_request(ram);
}

/*
 * Returns the order of the board since the last call: COMMRAM_START_NONE, _COLD, _WARM, _HOT or _STOP. After a reset
 * and while the supply is off, it returns _STOP to a program that runs. Call it before each scan, and report the new
 * state of the program by commram_tell.
 */
static inline uint32_t commram_order(commram_plc *plc)
{
    commram_header *header = plc->ram->header;
    uint32_t restarts = COMMRAM_LOAD(header->program.restarts), orders = COMMRAM_LOAD(header->program.start.word);
    int restarted = restarts != plc->restarts, ordered = orders != plc->orders;
    plc->restarts = restarts;
    plc->orders = orders;
    if (COMMRAM_LOAD(header->board.switch_) != COMMRAM_RUN_SWITCH_RUN
        || COMMRAM_LOAD(header->program.power) != COMMRAM_POWER_ON)
        return plc->runs ? COMMRAM_START_STOP : COMMRAM_START_NONE;
    if (ordered)
        return COMMRAM_LOAD(header->program.start_kind);
    return restarted && plc->runs ? COMMRAM_START_STOP : COMMRAM_START_NONE;
}

/*
 * Sets the initial value that a cold start writes to retain flag `flag`, counted from 0. `width` is 1, 2 or 4 bytes; 0
 * removes all initial values that were set before. Returns COMMRAM_REFUSED if the device has no such flag, or no cold
 * start that writes initial values.
 */
static inline commram_result
commram_give_initial_value(commram *ram, uint32_t flag, uint32_t width, uint32_t value, uint32_t timeout_ms)
{
    commram_initial_flag *slot = &ram->header->initial_flag;
    commram_expected answered;
    commram_result result;
    answered.cell = &slot->answer;
    answered.value = COMMRAM_LOAD(slot->answer) + 1u;
    answered.wanted = 1;
    if (!ram->writable)
        return COMMRAM_READ_ONLY;
    COMMRAM_STORE(slot->flag, flag);
    COMMRAM_STORE(slot->width, width);
    COMMRAM_STORE(slot->value, value);
    COMMRAM_STORE(slot->request, answered.value);
    commram_request(ram);
    result = commram_wait_until(ram, commram_is_expected, &answered, timeout_ms);
    if (result != COMMRAM_DONE)
        return result;
    return COMMRAM_LOAD(slot->result) == COMMRAM_INITIAL_FLAG_RESULT_DONE ? COMMRAM_DONE : COMMRAM_REFUSED;
}

/* Returns the reason why a loaded program does not run, in English. */
static inline const char *commram_stopped_because(const commram *ram)
{
    if (COMMRAM_LOAD(ram->header->program.power) != COMMRAM_POWER_ON)
        return "the program is stopped: the supply is off";
    if (COMMRAM_LOAD(ram->header->board.switch_) != COMMRAM_RUN_SWITCH_RUN)
        return "the program is stopped: the switch is not at RUN";
    if (COMMRAM_LOAD(ram->header->program.state) == COMMRAM_PROGRAM_STATE_NONE)
        return "the program is stopped: the device says that no program is loaded";
    return "the program is stopped: the device has ordered no start, or a stop";
}

/* Takes the program away. */
static inline void commram_unload(commram_plc *plc)
{
    COMMRAM_STORE(plc->ram->header->program.state, COMMRAM_PROGRAM_STATE_NONE);
    commram_request(plc->ram);
}
