/*
 * What matiec's variables point to. Until commram_matiec_attach maps the image over it, it is memory of this
 * process, so the initial values that config_init__ writes to every located variable never reach a register.
 */
#ifdef COMMRAM_MATIEC_BY_NAME
#define COMMRAM_MATIEC_TEXT char commram_matiec_refused[160];
#else
#define COMMRAM_MATIEC_TEXT
#endif
#define COMMRAM_MATIEC_STORAGE                                                                                   \
    COMMRAM_MATIEC_TEXT                                                                                          \
    unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES] __attribute__((aligned(0x10000)));
extern unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES];

/* Puts memory of this process, all zero, in the image's place; the variables stay usable. */
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

/* A start of the program: `init` gives its variables initial values, of which none reaches a register. */
static inline commram_result commram_matiec_start(commram *ram, const char *path, void (*init)(void))
{
    commram_matiec_detach(ram);
    init();
    return commram_matiec_attach(ram, path);
}

/*
 * For runtimes whose scans begin and go on without being asked; to be called in front of each, with a `ram` that begins
 * as zeros. Starts the program as soon as there is an emulator, and lets go of one that is gone.
 */
static inline commram_result commram_matiec_keep(commram *ram, const char *path, void (*init)(void))
{
    commram_result result = ram->base ? commram_check(ram) : commram_matiec_attach(ram, path);
    static int is_started;
    if (result != COMMRAM_DONE) {
        if (ram->base)
            commram_matiec_detach(ram);
        is_started = 0;
    } else if (!is_started) {
        result = commram_matiec_start(ram, path, init);
        is_started = result == COMMRAM_DONE;
    }
    return result;
}

/* Gives emulated time to a variable of matiec's type TIME. */
#define COMMRAM_MATIEC_TIME(ram, time)                                                                           \
    do {                                                                                                         \
        uint64_t commram_now = COMMRAM_LOAD((ram)->header->virtual_time_us);                                     \
        (time).tv_sec = (long)(commram_now / 1000000u);                                                          \
        (time).tv_nsec = (long)(commram_now % 1000000u) * 1000;                                                  \
    } while (0)

