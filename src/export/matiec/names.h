
/*
 * These functions compute the place of a located variable from the name that matiec derives from its address:
 * __MB3_200012_0 is %MB3.200012.0. A C++ compiler evaluates them; in C they run in config_init__.
 */
#ifdef __cplusplus
#define COMMRAM_CONSTANT constexpr
#else
#define COMMRAM_CONSTANT static inline
#endif
extern unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES];

COMMRAM_CONSTANT int commram_is_digit(char letter) { return letter >= '0' && letter <= '9'; }

/*
 * Returns 1 for the size X, and 2 for an address without a letter for the size. Such an address is the address of a
 * bit, too; matiec calls its size S.
 */
COMMRAM_CONSTANT int commram_is_bit(const char *name) { return name[3] == 'X' ? 1 : commram_is_digit(name[3]) ? 2 : 0; }

COMMRAM_CONSTANT unsigned commram_size(const char *name)
{
    return name[3] == 'L' ? 8u : name[3] == 'D' ? 4u : name[3] == 'W' ? 2u : 1u;
}

/* Reads the digits at `text` and appends them to the number `begun`. */
COMMRAM_CONSTANT unsigned commram_number(const char *text, unsigned begun)
{
    return !commram_is_digit(*text)  ? begun
           : begun > 0xFFFFFFFu / 10 ? COMMRAM_NO_NUMBER - 1u
                                     : commram_number(text + 1, begun * 10u + (unsigned)(*text - '0'));
}

/* Returns number `level` of the numbers at `text`, which are separated by `_`. */
COMMRAM_CONSTANT unsigned commram_level_in(const char *text, int level)
{
    return *text == 0     ? COMMRAM_NO_NUMBER
           : level == 0   ? commram_number(text, 0u)
           : *text == '_' ? commram_level_in(text + 1, level - 1)
                          : commram_level_in(text + 1, level);
}

COMMRAM_CONSTANT unsigned commram_level(const char *name, int level)
{
    return commram_level_in(name + (commram_is_bit(name) == 2 ? 3 : 4), level);
}

COMMRAM_CONSTANT int commram_levels_are_0(const char *name)
{
    return COMMRAM_IS_NO_LEVEL(commram_level(name, 2)) && COMMRAM_IS_NO_LEVEL(commram_level(name, 3))
           && COMMRAM_IS_NO_LEVEL(commram_level(name, 4)) && COMMRAM_IS_NO_LEVEL(commram_level(name, 5));
}

COMMRAM_CONSTANT int commram_is_in_ram(char letter, int is_bit, unsigned size, unsigned a, unsigned b)
{
    return (void)letter, (void)is_bit, (void)size, (void)b, COMMRAM_IN_RAM(letter, is_bit, size, a, b);
}

COMMRAM_CONSTANT unsigned commram_place_of(char letter, int is_bit, unsigned size, unsigned a, unsigned b)
{
    return (void)letter, (void)is_bit, (void)size, (void)b, COMMRAM_PLACE(letter, is_bit, size, a, b);
}

/* Returns 1 if the device has the address. If not, the variable belongs to the program or to the runtime. */
COMMRAM_CONSTANT int commram_is_bound(const char *name)
{
    return commram_is_in_ram(name[2], commram_is_bit(name), commram_size(name), commram_level(name, 0),
                             commram_level(name, 1));
}

COMMRAM_CONSTANT unsigned commram_place(const char *name)
{
    return commram_place_of(name[2], commram_is_bit(name), commram_size(name), commram_level(name, 0),
                            commram_level(name, 1));
}

COMMRAM_CONSTANT int commram_is_structure(unsigned place, unsigned long bytes)
{
    return COMMRAM_STRUCTURE_AT(place, bytes);
}

COMMRAM_CONSTANT unsigned commram_widths(unsigned place) { return COMMRAM_WIDTHS_AT(place); }

/* Returns the number of the bit among the bits of all flags; COMMRAM_NO_NUMBER if the place is no bit of a flag. */
COMMRAM_CONSTANT unsigned commram_bit_at(unsigned place, unsigned bit)
{
    return (void)place, (void)bit, COMMRAM_REACHED_BIT(place, bit);
}

COMMRAM_CONSTANT unsigned commram_bit_of(const char *name)
{
    return commram_is_bit(name) ? commram_bit_at(commram_place(name), commram_level(name, 1)) : COMMRAM_NO_NUMBER;
}

/* Returns the memory to which a variable of the device points. */
static inline unsigned char *commram_matiec_at(const char *name)
{
    return commram_is_bit(name) ? commram_matiec_bits + commram_bit_of(name) : commram_matiec_ram + commram_place(name);
}

#define COMMRAM_RULES_OF(rule, name, bytes)                                                                      \
    COMMRAM_RULES(rule, name, commram_is_bound(name), commram_is_bit(name), commram_size(name),                  \
                  commram_levels_are_0(name), bytes, commram_is_structure(commram_place(name), bytes),           \
                  commram_place(name), commram_widths(commram_place(name)), commram_bit_of(name))

#ifdef __cplusplus
/*
 * OpenPLC's glue_generator has tables of limited length, and none for %MB. For an address with a higher number, it
 * would write after the end of a table.
 */
#define COMMRAM_RULE_OF_TABLES(name)                                                                             \
    COMMRAM_RULE(!commram_is_bound(name) || (name[2] == 'M' && name[3] == 'B') || commram_level(name, 0) < 1024u, name,\
                 "OpenPLC has tables for numbers below 1024 only; locate bytes, %MB")
#define COMMRAM_RULE(condition, name, text) static_assert(condition, name ": " text);
#define COMMRAM_OTHER(type, location) extern type *location;
#define COMMRAM_ACCEPT(type, location) COMMRAM_RULES_OF(COMMRAM_RULE, #location, sizeof(type)) COMMRAM_RULE_OF_TABLES(#location)
#define COMMRAM_BOUND(type, location)                                                                            \
    (commram_is_bound(#location) ? (type *)(void *)commram_matiec_at(#location) : location)
#else
/* Description of the error in the first variable that was refused. If it is not empty, the program must not attach. */
extern char commram_matiec_refused[160];

#define COMMRAM_RULE(condition, name, text) if (!(condition)) return text;
static inline const char *commram_refusal(const char *name, size_t bytes)
{
    COMMRAM_RULES_OF(COMMRAM_RULE, name, bytes)
    return NULL;
}

/*
 * Returns the address of a variable. `other` is the address of the variable that another library has under this name;
 * NULL if there is none.
 */
static inline void *commram_bound(const char *name, size_t bytes, void *other)
{
    const char *wrong = !commram_is_bound(name) ? (other ? NULL : "the device has no such address, and no library has it")
                                                : commram_refusal(name, bytes);
    if (!wrong)
        return commram_is_bound(name) ? commram_matiec_at(name) : other;
    if (!commram_matiec_refused[0])
        snprintf(commram_matiec_refused, sizeof commram_matiec_refused, "%s: %s", name, wrong);
    return commram_matiec_ram;
}

#define COMMRAM_OTHER(type, location) extern type *location __attribute__((weak));
#define COMMRAM_ACCEPT(type, location)
#define COMMRAM_BOUND(type, location) commram_bound(#location, sizeof(type), &location ? (void *)location : NULL)
#endif

#undef __DECLARE_GLOBAL_LOCATION
#undef __INIT_GLOBAL_LOCATED
#undef __INIT_LOCATED
#define __DECLARE_GLOBAL_LOCATION(type, location) COMMRAM_OTHER(type, location)
#define __INIT_GLOBAL_LOCATED(domain, name, location, retained)                                                  \
    {                                                                                                            \
        COMMRAM_ACCEPT(__typeof__(*location), location)                                                          \
        domain##__##name.value = COMMRAM_BOUND(__typeof__(*location), location);                                 \
        domain##__##name.flags |= retained ? __IEC_RETAIN_FLAG : 0;                                              \
    }
#define __INIT_LOCATED(type, location, name, retained)                                                           \
    {                                                                                                            \
        COMMRAM_OTHER(type, location)                                                                            \
        COMMRAM_ACCEPT(type, location)                                                                           \
        name.value = COMMRAM_BOUND(type, location);                                                              \
        name.flags |= retained ? __IEC_RETAIN_FLAG : 0;                                                          \
    }
