
/*
 * Functions for the parts of the function blocks (commram export st --blocks) that Structured Text cannot do with
 * registers. They store requests to the board in the header page, as the blocks on the device call its firmware. Until
 * an image is mapped, the requests go to memory of this process.
 */
static inline commram_header *commram_matiec_header(void)
{
    return (commram_header *)(void *)commram_matiec_ram;
}

/*
 * Called after a block has stored 16#0000 in w_CPU_CONTROL of a node (D-29). `node` is the address of the node's
 * structure.
 */
static inline void commram_matiec_restarted(const volatile void *node)
{
    commram_header *header = commram_matiec_header();
    size_t i, offset = (size_t)((const volatile unsigned char *)node - commram_matiec_ram);
    for (i = 0; i < sizeof header->ports / sizeof header->ports[0]; i++) {
        if (COMMRAM_LOAD(header->ports[i].file_offset) == offset) {
            COMMRAM_ADD(header->ports[i].restarts_written, 1);
            return;
        }
    }
}

/* Returns the number of resets and power-ons of the board. Each of them cancels all earlier requests. */
static inline uint32_t commram_matiec_restarts(void)
{
    return COMMRAM_LOAD(commram_matiec_header()->program.restarts);
}

/* Returns 0 if the request is not answered, 1 if it is done, 2 if it was refused. */
static inline uint32_t commram_matiec_answer(uint32_t answered, uint32_t request, uint32_t result)
{
    return answered != request ? 0 : result == 0 ? 1 : 2;
}

/* Stores a request of INTR_SET, and returns the number by which the answer is recognized. `event` is 0 to 15. */
static inline uint32_t commram_matiec_intr_ask(int8_t event, int16_t par1, uint8_t enable)
{
    commram_header *header = commram_matiec_header();
    commram_interrupt *slot = &header->interrupts[event & 15];
    uint32_t number = ((COMMRAM_LOAD(slot->answer) >> 1) + 1u) & 0x7FFFu;
    uint32_t request = (uint32_t)(uint16_t)par1 << 16 | number << 1 | (enable ? 1u : 0u);
    COMMRAM_STORE(slot->request, request);
    COMMRAM_ADD(header->board_requests, 1);
    return request;
}

static inline uint32_t commram_matiec_intr_answer(int8_t event, uint32_t request)
{
    commram_interrupt *slot = &commram_matiec_header()->interrupts[event & 15];
    uint32_t answered = COMMRAM_LOAD(slot->answer);
    return commram_matiec_answer(answered, request, COMMRAM_LOAD(slot->result));
}

/* OPT_INIT: its inputs, then the request. */
static inline void commram_matiec_opt_trigger(unsigned trigger, uint8_t mode)
{
    COMMRAM_STORE(commram_matiec_header()->opt_init.triggers[trigger], mode);
}

static inline void commram_matiec_opt_timer(unsigned timer, uint16_t divider, uint8_t enable, uint32_t cfg_mode)
{
    commram_timer_setup *setup = &commram_matiec_header()->opt_init.timers[timer];
    COMMRAM_STORE(setup->divider, divider);
    COMMRAM_STORE(setup->enable, enable ? 1u : 0u);
    COMMRAM_STORE(setup->cfg_mode, cfg_mode);
}

static inline uint32_t commram_matiec_opt_ask(void)
{
    commram_header *header = commram_matiec_header();
    uint32_t request = COMMRAM_LOAD(header->opt_init.answer) + 1u;
    COMMRAM_STORE(header->opt_init.request, request);
    COMMRAM_ADD(header->board_requests, 1);
    return request;
}

static inline uint32_t commram_matiec_opt_answer(uint32_t request)
{
    commram_opt_init *slot = &commram_matiec_header()->opt_init;
    uint32_t answered = COMMRAM_LOAD(slot->answer);
    return commram_matiec_answer(answered, request, COMMRAM_LOAD(slot->result));
}

static inline void commram_matiec_leds(uint8_t leds)
{
    COMMRAM_STORE(commram_matiec_header()->board.leds, leds & 0x0Fu);
}

/*
 * Returns the emulated time in microseconds at this moment. In real time it also advances between two actions of the
 * firmware. The result is at most 100 ms after virtual_time_us, so that the time does not fall when the speed changes.
 */
static inline uint32_t commram_matiec_exact_us(void)
{
    commram_header *header = commram_matiec_header();
    uint32_t tries;
    for (tries = 0; tries < 1000000u; tries++) {
        uint64_t epoch = COMMRAM_LOAD(header->real_epoch_ns), speed = COMMRAM_LOAD(header->speed);
        uint64_t us, ns, exact;
        struct timespec now;
        /* The speed is 0 in stepped mode, and while the clock is paused. */
        if (speed == 0)
            break;
        us = COMMRAM_LOAD(header->virtual_time_us);
        clock_gettime(CLOCK_MONOTONIC, &now);
        /* The epoch is 0 while the emulator changes the speed. */
        if (epoch == 0 || COMMRAM_LOAD(header->real_epoch_ns) != epoch)
            continue;
        ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
        ns -= epoch; /* modulo 2^64: the epoch of a slow clock may be before the begin of CLOCK_MONOTONIC */
        ns = ns >> 63 ? 0 : ns;
        exact = ns / 1000000u * speed + ns % 1000000u * speed / 1000000u;
        exact = exact > us ? exact : us;
        return (uint32_t)(exact - us > 100000u ? us + 100000u : exact);
    }
    return (uint32_t)COMMRAM_LOAD(header->virtual_time_us);
}
