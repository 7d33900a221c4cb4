/*
 * The storage to which matiec's variables point. It is memory of this process until commram_matiec_attach maps the
 * image over it. So the initial values that config_init__ writes to every located variable never reach a register.
 */
#ifdef COMMRAM_MATIEC_BY_NAME
#define COMMRAM_MATIEC_TEXT char commram_matiec_refused[160];
#else
#define COMMRAM_MATIEC_TEXT
#endif
#define COMMRAM_MATIEC_STORAGE                                                                                   \
    COMMRAM_MATIEC_TEXT                                                                                          \
    int commram_matiec_keeps_retain;                                                                             \
    unsigned char commram_matiec_bits[COMMRAM_FLAG_BITS];                                                        \
    unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES] __attribute__((aligned(0x10000)));
extern unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES];
extern int commram_matiec_keeps_retain;
extern unsigned char commram_matiec_bits[COMMRAM_FLAG_BITS];

/*
 * Initial values of located flags, as the last config_init__ has written them: first those of the retain flags, then
 * those of the other flags.
 */
static unsigned char commram_matiec_initial[COMMRAM_MATIEC_RETAIN_BYTES + COMMRAM_MATIEC_FLAGS_BYTES + 1u];

/* Replaces the image by zeroed memory of this process. The variables can still be used. */
static inline void commram_matiec_detach(commram *ram)
{
    mmap(commram_matiec_ram, COMMRAM_SEGMENT_SIZE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED,
         -1, 0);
    if (ram->base) {
        ram->base = NULL;
        commram_detach(ram);
    }
}

/* Maps the image `path` over the storage. Call it after config_init__ and before the first scan. */
static inline commram_result commram_matiec_attach(commram *ram, const char *path)
{
    commram_result result;
    int file = open(path, O_RDWR | COMMRAM_O_NOFOLLOW | COMMRAM_O_CLOEXEC | O_NONBLOCK);
    if (file < 0)
        return COMMRAM_NO_IMAGE;
    result = commram_check_file(file);
    if (result == COMMRAM_DONE)
        result = commram_map(ram, file, 1, commram_matiec_ram);
    if (result != COMMRAM_DONE) {
        ram->base = commram_matiec_ram;
        ram->file = file;
        commram_matiec_detach(ram);
    }
    return result;
}

/* Saves the initial values of located flags and of their bits. Call it before an image is mapped over these flags. */
static inline void commram_matiec_keep_initial(void)
{
    size_t i, bytes = COMMRAM_MATIEC_RETAIN_BYTES + COMMRAM_MATIEC_FLAGS_BYTES;
    for (i = 0; i < bytes; i++) {
        unsigned bit, value = commram_matiec_ram[COMMRAM_FLAG_BYTE(i)];
        for (bit = 0; bit < 8u; bit++)
            value |= commram_matiec_bits[8u * i + bit] ? 1u << bit : 0u;
        commram_matiec_initial[i] = (unsigned char)value;
    }
}

/*
 * Starts the program. `kind` is COMMRAM_START_COLD or COMMRAM_START_WARM. `init` gives the variables their initial
 * values; at a warm start, variables that are declared RETAIN keep their values. No initial value reaches a register.
 * This function writes the initial values of flags that are not retained, and commram_matiec_flags sets those of retain
 * flags.
 */
static inline commram_result
commram_matiec_begin(commram *ram, const char *path, void (*init)(void), uint32_t kind)
{
    commram_result result;
    size_t i, bytes = COMMRAM_MATIEC_RETAIN_BYTES + COMMRAM_MATIEC_FLAGS_BYTES;
    commram_matiec_detach(ram);
    commram_matiec_keeps_retain = kind == COMMRAM_START_WARM;
    init();
    commram_matiec_keeps_retain = 0;
    commram_matiec_keep_initial();
    result = commram_matiec_attach(ram, path);
    for (i = COMMRAM_MATIEC_RETAIN_BYTES; result == COMMRAM_DONE && i < bytes; i++) {
        /* The device has set all flags to 0 when it ordered the start, so an initial value of 0 needs no write. */
        if (commram_matiec_initial[i])
            *(volatile unsigned char *)(commram_matiec_ram + COMMRAM_FLAG_BYTE(i)) = commram_matiec_initial[i];
    }
    return result;
}

/* Starts the program for the first time, before the board has ordered a start. */
static inline commram_result commram_matiec_start(commram *ram, const char *path, void (*init)(void))
{
    return commram_matiec_begin(ram, path, init, COMMRAM_START_COLD);
}

/*
 * Registers the initial values that each cold start gives to the retain flags of the program. Call it after
 * commram_matiec_start and before commram_load. Returns COMMRAM_REFUSED if the device gives flags no initial values, or
 * has fewer flags.
 */
static inline commram_result commram_matiec_flags(commram *ram, uint32_t timeout_ms)
{
    commram_result result = COMMRAM_DONE;
    uint32_t i, has_any = 0, bytes = COMMRAM_MATIEC_RETAIN_BYTES;
    for (i = 0; i < bytes; i++)
        has_any |= commram_matiec_initial[i];
    if (bytes) {
        result = commram_give_initial_value(ram, 0, 0, 0, timeout_ms);
        if (result == COMMRAM_REFUSED && !has_any)
            return COMMRAM_DONE;
    }
    for (i = 0; result == COMMRAM_DONE && i + 4u <= bytes; i += 4u) {
        uint32_t value;
        memcpy(&value, commram_matiec_initial + i, sizeof value);
        if (value)
            result = commram_give_initial_value(ram, i, 4, value, timeout_ms);
    }
    return result;
}

/* The program of a runtime that does not wait before a scan, see commram_matiec_keep. */
typedef struct commram_matiec_program {
    commram board; /* the image a second time, for orders */
    commram_plc plc;
} commram_matiec_program;

/* Longest real time for the board to order the first start, and to answer a request. */
#define COMMRAM_MATIEC_FIRST_MS 50u
#define COMMRAM_MATIEC_ANSWER_MS 1000u

static inline commram_result
commram_matiec_load(commram_matiec_program *program, commram *ram, const char *path, void (*init)(void))
{
    commram_result result = commram_attach(&program->board, path, 1);
    if (result != COMMRAM_DONE)
        return result;
    result = commram_matiec_start(ram, path, init);
    commram_matiec_detach(ram);
    if (result == COMMRAM_DONE)
        result = commram_matiec_flags(&program->board, COMMRAM_MATIEC_ANSWER_MS);
    if (result == COMMRAM_DONE || result == COMMRAM_REFUSED)
        result = commram_load(&program->plc, &program->board);
    if (result == COMMRAM_DONE) {
        result = commram_wait_ring(&program->board, &program->board.header->program.start, program->plc.orders,
                                   COMMRAM_MATIEC_FIRST_MS);
        result = result == COMMRAM_TIMEOUT ? COMMRAM_DONE : result;
    }
    if (result != COMMRAM_DONE)
        commram_detach(&program->board);
    return result;
}

/*
 * Executes the orders of the board. The image is mapped over the storage of the located variables only while the
 * program may run.
 */
static inline commram_result
commram_matiec_obey(commram_matiec_program *program, commram *ram, const char *path, void (*init)(void))
{
    uint32_t order = commram_order(&program->plc);
    commram_result result = COMMRAM_DONE;
    switch (order) {
    case COMMRAM_START_COLD:
    case COMMRAM_START_WARM:
        result = commram_matiec_begin(ram, path, init, order);
        break;
    case COMMRAM_START_HOT:
        result = ram->base ? COMMRAM_DONE : commram_matiec_attach(ram, path);
        break;
    case COMMRAM_START_STOP:
        commram_matiec_detach(ram);
        commram_tell(&program->plc, COMMRAM_PROGRAM_STATE_STOPPED);
        return COMMRAM_STOPPED;
    default:
        return program->plc.runs ? COMMRAM_DONE : COMMRAM_STOPPED;
    }
    if (result == COMMRAM_DONE)
        commram_tell(&program->plc, COMMRAM_PROGRAM_STATE_CYCLIC);
    return result;
}

static inline commram_matiec_program *commram_matiec_own(void)
{
    static commram_matiec_program program;
    return &program;
}

/*
 * For runtimes that begin each scan by their own clock. Call it before each scan; `ram` must be zero at the first call.
 * Attaches as soon as an emulator runs, starts and stops the program as the board orders, and detaches when the
 * emulator has ended. Returns COMMRAM_STOPPED while the program is stopped. Its scans then use memory of this process.
 */
static inline commram_result commram_matiec_keep(commram *ram, const char *path, void (*init)(void))
{
    commram_matiec_program *program = commram_matiec_own();
    commram_result result = program->board.base ? commram_check(&program->board) : commram_matiec_load(program, ram, path, init);
    if (result == COMMRAM_DONE)
        result = commram_matiec_obey(program, ram, path, init);
    if (result != COMMRAM_DONE && result != COMMRAM_STOPPED && program->board.base) {
        commram_matiec_detach(ram);
        commram_detach(&program->board);
    }
    return result;
}

/* Ends a program that commram_matiec_keep has started, and reports its end to the board. */
static inline void commram_matiec_leave(commram *ram)
{
    commram_matiec_program *program = commram_matiec_own();
    commram_matiec_detach(ram);
    if (program->board.base) {
        commram_unload(&program->plc);
        commram_detach(&program->board);
    }
}

/* Sets a variable of matiec's type TIME to the emulated time. */
#define COMMRAM_MATIEC_TIME(ram, time)                                                                           \
    do {                                                                                                         \
        uint64_t commram_now = COMMRAM_LOAD((ram)->header->virtual_time_us);                                     \
        (time).tv_sec = (long)(commram_now / 1000000u);                                                          \
        (time).tv_nsec = (long)(commram_now % 1000000u) * 1000;                                                  \
    } while (0)

