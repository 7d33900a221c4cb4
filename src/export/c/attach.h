
/* Result of a function that can fail. */
typedef enum commram_result {
    COMMRAM_DONE = 0,
    COMMRAM_NO_IMAGE,     /* no file of that name, or no regular file; errno tells more */
    COMMRAM_NOT_YOURS,    /* the file belongs to another user */
    COMMRAM_TOO_SHORT,    /* the file is shorter than it says, or than an image is */
    COMMRAM_WRONG_MAGIC,  /* the file is no image */
    COMMRAM_WRONG_ABI,    /* made by another version of the attach contract */
    COMMRAM_WRONG_LAYOUT, /* its registers lie elsewhere: export this header again */
    COMMRAM_NOT_READY,    /* the emulator is starting; try again a little later */
    COMMRAM_NOT_MAPPED,   /* mmap failed; errno tells why */
    COMMRAM_GONE,         /* the emulator has ended, was killed, or has been replaced */
    COMMRAM_TIMEOUT,      /* not within the given time */
    COMMRAM_READ_ONLY,    /* attached for reading */
    COMMRAM_REFUSED,      /* the emulator says no; what was asked for tells why */
    COMMRAM_NO_SEAT,      /* all seats of lockstep are taken */
    COMMRAM_LOST,         /* the emulator has given the task up: its turn took too long */
    COMMRAM_STOPPED       /* the board has ordered no start of the program, or a stop */
} commram_result;

/* An attached image. */
typedef struct commram {
    unsigned char *base;    /* first byte of the image */
    commram_header *header; /* the first page */
    int file;               /* its descriptor */
    int writable;
    uint32_t generation;    /* of the emulator that was there when attaching */
} commram;

/*
 * Message about an image with another version or register map. commram_check_file writes the message, and commram_text
 * returns it.
 */
static char commram_versions[200];

/* What a result means, in English. */
static inline const char *commram_text(commram_result result)
{
    if ((result == COMMRAM_WRONG_ABI || result == COMMRAM_WRONG_LAYOUT) && commram_versions[0])
        return commram_versions;
    switch (result) {
    case COMMRAM_DONE: return "done";
    case COMMRAM_NO_IMAGE: return "there is no image of that name";
    case COMMRAM_NOT_YOURS: return "the image belongs to another user";
    case COMMRAM_TOO_SHORT: return "the image is too short";
    case COMMRAM_WRONG_MAGIC: return "the file is no image of a communication RAM";
    case COMMRAM_WRONG_ABI: return "the image has another version of the attach contract";
    case COMMRAM_WRONG_LAYOUT: return "the image has another register map";
    case COMMRAM_NOT_READY: return "the emulator is not ready yet";
    case COMMRAM_NOT_MAPPED: return "the image cannot be mapped";
    case COMMRAM_GONE: return "the emulator is gone";
    case COMMRAM_TIMEOUT: return "not within the time allowed";
    case COMMRAM_READ_ONLY: return "attached for reading only";
    case COMMRAM_REFUSED: return "the emulator refuses it";
    case COMMRAM_NO_SEAT: return "all seats are taken";
    case COMMRAM_LOST: return "the emulator has given the task up, its turn took too long";
    case COMMRAM_STOPPED: return "the program is stopped: the board has ordered no start, or a stop";
    }
    return "unknown result";
}

/*
 * Returns the start time of process `pid` in clock ticks since boot; 0 if there is no such process, or if it is a
 * zombie.
 */
static inline uint64_t commram_process_start(uint32_t pid)
{
    char path[40], text[1024], *field;
    ssize_t length;
    int file, i;
    snprintf(path, sizeof path, "/proc/%u/stat", (unsigned)pid);
    file = open(path, O_RDONLY | COMMRAM_O_CLOEXEC);
    if (file < 0)
        return 0;
    length = read(file, text, sizeof text - 1);
    close(file);
    text[length > 0 ? length : 0] = 0;
    /*
     * Field 2, the name of the command, may contain any character, so the search begins at its end. Field 3 is the
     * state, and field 22 is the start time.
     */
    field = strrchr(text, ')');
    if (!field || field[1] != ' ' || field[2] == 'Z' || field[2] == 'X')
        return 0;
    for (i = 2; i < 22 && field; i++)
        field = strchr(field + 1, ' ');
    return field ? strtoull(field + 1, NULL, 10) : 0;
}

/* Returns 1 if process `pid` exists, is no zombie, and started at `start` clock ticks since boot; otherwise 0. */
static inline int commram_process_runs(uint32_t pid, uint64_t start)
{
    return start != 0 && commram_process_start(pid) == start;
}

/* Returns COMMRAM_DONE while the emulator to which this program has attached runs and is ready. */
static inline commram_result commram_check(const commram *ram)
{
    const commram_header *header = ram->header;
    uint32_t state = COMMRAM_LOAD(header->state);
    if (COMMRAM_LOAD(header->generation) != ram->generation)
        return COMMRAM_GONE;
    if (state == COMMRAM_STATE_STARTING)
        return COMMRAM_NOT_READY;
    if (state != COMMRAM_STATE_READY)
        return COMMRAM_GONE;
    if (commram_process_runs(COMMRAM_LOAD(header->firmware_pid), COMMRAM_LOAD(header->firmware_start)))
        return COMMRAM_DONE;
    /*
     * The process of the emulator may be in another PID namespace, where it is not visible. A running emulator holds
     * the lock of the file.
     */
    if (flock(ram->file, LOCK_SH | LOCK_NB) == 0) {
        flock(ram->file, LOCK_UN);
        return COMMRAM_GONE;
    }
    return errno == EWOULDBLOCK ? COMMRAM_DONE : COMMRAM_GONE;
}

/* Checks an open file as docs/reference/attach.md describes, in the same order. */
static inline commram_result commram_check_file(int file)
{
    struct { uint64_t magic; uint32_t abi_version, header_size; uint64_t layout_hash; uint32_t segment_size, generation; } head;
    uint64_t base;
    struct stat info;
    if (fstat(file, &info) || !S_ISREG(info.st_mode))
        return COMMRAM_NO_IMAGE;
    if (info.st_uid != geteuid())
        return COMMRAM_NOT_YOURS;
    if (lseek(file, 0, SEEK_SET) != 0 || read(file, &head, sizeof head) != (ssize_t)sizeof head)
        return COMMRAM_TOO_SHORT;
    if (head.magic != COMMRAM_MAGIC)
        return COMMRAM_WRONG_MAGIC;
    if (head.abi_version != COMMRAM_ABI_VERSION) {
        snprintf(commram_versions, sizeof commram_versions,
                 "the image has ABI version %u, this program was built for %u: build it with the header that "
                 "`commram export c` of that emulator's version writes",
                 (unsigned)head.abi_version, (unsigned)COMMRAM_ABI_VERSION);
        return COMMRAM_WRONG_ABI;
    }
    /* A controller with option cards also has all registers of the map without them. */
    if (head.layout_hash != COMMRAM_LAYOUT_HASH
        && (lseek(file, offsetof(commram_header, base_layout_hash), SEEK_SET) < 0
            || read(file, &base, sizeof base) != (ssize_t)sizeof base || base != COMMRAM_LAYOUT_HASH)) {
        snprintf(commram_versions, sizeof commram_versions,
                 "the image has register map 16#%016llX, this program was built for 16#%016llX: build it with the header that `commram export c` writes for that device",
                 (unsigned long long)head.layout_hash, (unsigned long long)COMMRAM_LAYOUT_HASH);
        return COMMRAM_WRONG_LAYOUT;
    }
    if (head.segment_size != COMMRAM_SEGMENT_SIZE || info.st_size < (off_t)COMMRAM_SEGMENT_SIZE)
        return COMMRAM_TOO_SHORT;
    return COMMRAM_DONE;
}

/* Maps the open file `file`, at the address `place` if it is not NULL, and fills `ram`. */
static inline commram_result commram_map(commram *ram, int file, int writable, void *place)
{
    int protection = PROT_READ | (writable ? PROT_WRITE : 0);
    void *base = mmap(place, COMMRAM_SEGMENT_SIZE, protection, MAP_SHARED | (place ? MAP_FIXED : 0), file, 0);
    if (base == MAP_FAILED)
        return COMMRAM_NOT_MAPPED;
    ram->base = (unsigned char *)base;
    ram->header = (commram_header *)base;
    ram->file = file;
    ram->writable = writable;
    ram->generation = COMMRAM_LOAD(ram->header->generation);
    return commram_check(ram);
}

/* Unmaps the image. The emulator continues. */
static inline void commram_detach(commram *ram)
{
    if (ram->base)
        munmap(ram->base, COMMRAM_SEGMENT_SIZE);
    if (ram->file >= 0)
        close(ram->file);
    ram->base = NULL;
    ram->header = NULL;
    ram->file = -1;
}

/*
 * Attaches to the image file `path`, for example "/dev/shm/commram.default.line"; with `writable` 0 for reading only.
 * After an error, no file stays open.
 */
static inline commram_result commram_attach(commram *ram, const char *path, int writable)
{
    commram_result result;
    int file = open(path, (writable ? O_RDWR : O_RDONLY) | COMMRAM_O_NOFOLLOW | COMMRAM_O_CLOEXEC | O_NONBLOCK);
    ram->base = NULL;
    ram->header = NULL;
    ram->file = file;
    if (file < 0)
        return COMMRAM_NO_IMAGE;
    result = commram_check_file(file);
    if (result == COMMRAM_DONE)
        result = commram_map(ram, file, writable, NULL);
    if (result != COMMRAM_DONE)
        commram_detach(ram);
    return result;
}

/* Notifies the firmware of stores. Call it after the last store. */
static inline commram_result commram_ring(commram *ram)
{
    commram_bell *bell = &ram->header->doorbell;
    if (!ram->writable)
        return COMMRAM_READ_ONLY;
    COMMRAM_ADD(bell->word, 1);
    if (COMMRAM_LOAD(bell->waiters))
        commram_system(SYS_futex, (uint32_t *)&bell->word, FUTEX_WAKE, INT_MAX, NULL, NULL, 0);
    return COMMRAM_DONE;
}

/*
 * Sleeps until `bell` has rung more often than `seen` times, at most 100 ms. Read `seen` from bell->word first,
 * then check whether the awaited value is already present. A spurious return is possible.
 */
static inline void commram_sleep(const commram *ram, commram_bell *bell, uint32_t seen)
{
    commram_timespec slice = { 0, 100000000 };
    if (!ram->writable) {
        /* A reader of a read-only map cannot count itself in `waiters`, so it polls. */
        slice.nanoseconds = 1000000;
        commram_system(SYS_nanosleep, &slice, NULL);
        return;
    }
    COMMRAM_ADD(bell->waiters, 1);
    if (COMMRAM_LOAD(bell->word) == seen)
        commram_system(SYS_futex, (uint32_t *)&bell->word, FUTEX_WAIT, seen, &slice, NULL, 0);
    COMMRAM_SUB(bell->waiters, 1);
}

static inline uint64_t commram_now_ms(void)
{
    commram_timespec now = { 0, 0 };
    commram_system(SYS_clock_gettime, 1L /* CLOCK_MONOTONIC */, &now);
    return (uint64_t)now.seconds * 1000u + (uint64_t)now.nanoseconds / 1000000u;
}

/* Waits until `done(ram, context)` returns a value other than 0, for at most `timeout_ms` milliseconds of real time. */
static inline commram_result
commram_wait_until(commram *ram, int (*done)(const commram *, void *), void *context, uint32_t timeout_ms)
{
    uint64_t end = commram_now_ms() + timeout_ms;
    for (;;) {
        commram_bell *bell = &ram->header->answer;
        uint32_t seen = COMMRAM_LOAD(bell->word);
        commram_result result;
        if (done(ram, context))
            return COMMRAM_DONE;
        result = commram_check(ram);
        if (result != COMMRAM_DONE)
            return result;
        if (commram_now_ms() >= end)
            return COMMRAM_TIMEOUT;
        commram_sleep(ram, bell, seen);
    }
}

/* A register of `width` bytes, and the value for which a program waits in the bits of `mask`. */
typedef struct commram_awaited {
    uint32_t address, width, mask, value;
} commram_awaited;

/* Returns the unsigned value of the register at byte `address` of the image. `width` is 1, 2 or 4 bytes. */
static inline uint32_t commram_value(const commram *ram, uint32_t address, uint32_t width)
{
    unsigned char *at = ram->base + address;
    switch (width) {
    case 1: return COMMRAM_LOAD(*(COMMRAM_CELL(uint8_t) *)at);
    case 2: return COMMRAM_LOAD(*(COMMRAM_CELL(uint16_t) *)at);
    default: return COMMRAM_LOAD(*(COMMRAM_CELL(uint32_t) *)at);
    }
}

static inline int commram_is_there(const commram *ram, void *context)
{
    const commram_awaited *awaited = (const commram_awaited *)context;
    return (commram_value(ram, awaited->address, awaited->width) & awaited->mask) == awaited->value;
}

/*
 * Waits until the register `cell` of `ram`, a member of one of the structures, has `value`:
 * COMMRAM_AWAIT(&ram, node->w_OPTION_STATUS, 0x0043, 1000).
 */
#define COMMRAM_AWAIT(ram, cell, wanted, timeout_ms)                                                             \
    commram_await((ram), (const volatile void *)&(cell), sizeof(cell), UINT32_MAX, (uint32_t)(wanted), (timeout_ms))

/* Waits like COMMRAM_AWAIT, but compares only the bits of `mask`. */
#define COMMRAM_AWAIT_BITS(ram, cell, mask, wanted, timeout_ms)                                                  \
    commram_await((ram), (const volatile void *)&(cell), sizeof(cell), (mask), (uint32_t)(wanted), (timeout_ms))

static inline commram_result commram_await(commram *ram, const volatile void *cell, size_t width, uint32_t mask,
                                           uint32_t value, uint32_t timeout_ms)
{
    commram_awaited awaited;
    uint32_t all = UINT32_MAX >> (32 - 8 * width);
    awaited.address = (uint32_t)((const volatile unsigned char *)cell - ram->base);
    awaited.width = (uint32_t)width;
    awaited.mask = mask & all;
    awaited.value = value & awaited.mask;
    return commram_wait_until(ram, commram_is_there, &awaited, timeout_ms);
}
