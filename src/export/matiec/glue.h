/*
 * How to use it: docs/export.md. In short, one C file of the application, `commram export matiec --main`, has
 *
 *     #include "iec_std_lib.h"
 *     #include "commram_matiec.h"
 *     #include "POUS.h"
 *     COMMRAM_MATIEC_STORAGE
 *     #include "commram_located.h"
 *
 * where commram_located.h is what is in matiec's LOCATED_VARIABLES.h without the names of other variables that matiec
 * writes in between, without line ends and some lines twice:
 *
 *     grep -o '__LOCATED_VAR([^)]*)' LOCATED_VARIABLES.h | sort -u > commram_located.h
 *
 * All files are compiled with -DCOMMRAM_MATIEC_ACCESS -include commram_matiec.h.
 */

/*
 * What matiec's variables point to. Until commram_matiec_attach maps the image over it, it is memory of this
 * process, so the initial values that config_init__ writes to every located variable never reach a register.
 */
#define COMMRAM_MATIEC_BYTES ((COMMRAM_SEGMENT_SIZE + 0xFFFFu) / 0x10000u * 0x10000u)
#define COMMRAM_MATIEC_STORAGE                                                                                   \
    unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES] __attribute__((aligned(0x10000)));
extern unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES];

/* Without a letter for the size, %M3.200012, an address is that of a bit; matiec calls that size S. */
#define COMMRAM_SIZE_S 1u
#define COMMRAM_SIZE_X 1u
#define COMMRAM_SIZE_B 1u
#define COMMRAM_SIZE_W 2u
#define COMMRAM_SIZE_D 4u
#define COMMRAM_SIZE_L 8u
#define COMMRAM_IS_BIT_S 2
#define COMMRAM_IS_BIT_X 1
#define COMMRAM_IS_BIT_B 0
#define COMMRAM_IS_BIT_W 0
#define COMMRAM_IS_BIT_D 0
#define COMMRAM_IS_BIT_L 0
#define COMMRAM_LETTER_M 'M'
#define COMMRAM_LETTER_I 'I'
#define COMMRAM_LETTER_Q 'Q'

/* Levels of 0 behind an address are other spellings of it: %MB3.200012.0. */
#define COMMRAM_IS_NO_LEVEL(n) ((n) == 0u || (n) == COMMRAM_NO_NUMBER)

/* commram_located.h: one of these per address, with one to six numbers: %MB3.200012, %QX0.1, %MW7. */
#define __LOCATED_VAR(type, name, area, size, ...)                                                               \
    COMMRAM_LOCATED(type, name, COMMRAM_LETTER_##area, COMMRAM_IS_BIT_##size, COMMRAM_SIZE_##size, __VA_ARGS__,  \
                    COMMRAM_NO_NUMBER, COMMRAM_NO_NUMBER, COMMRAM_NO_NUMBER, COMMRAM_NO_NUMBER,                  \
                    COMMRAM_NO_NUMBER, COMMRAM_NO_NUMBER, )
#define COMMRAM_LOCATED(type, name, letter, is_bit, size, a, b, c, d, e, f, ...)                                 \
    enum {                                                                                                       \
        commram_bound_##name = COMMRAM_IN_RAM(letter, is_bit, size, a, b),                                       \
        commram_place_##name = COMMRAM_PLACE(letter, is_bit, size, a, b)                                         \
    };                                                                                                           \
    enum {                                                                                                       \
        commram_whole_##name = COMMRAM_STRUCTURE_AT(commram_place_##name, sizeof(type)),                         \
        commram_widths_##name = COMMRAM_WIDTHS_AT(commram_place_##name)                                          \
    };                                                                                                           \
    COMMRAM_CHECK(!commram_bound_##name || (is_bit) != 2, name,                                                  \
                  "an address without a size is that of a bit; write %MB, %MW or %MD")                           \
    COMMRAM_CHECK(!commram_bound_##name || !(is_bit), name,                                                      \
                  "a single bit has no address of its own; locate the byte")                                     \
    COMMRAM_CHECK(!commram_bound_##name || (is_bit)                                                              \
                      || (COMMRAM_IS_NO_LEVEL(c) && COMMRAM_IS_NO_LEVEL(d) && COMMRAM_IS_NO_LEVEL(e)             \
                          && COMMRAM_IS_NO_LEVEL(f)),                                                            \
                  name, "the address has levels too many; only 0 may stand there")                               \
    COMMRAM_CHECK(!commram_bound_##name || sizeof(type) <= 8 || commram_whole_##name, name,                      \
                  "no structure of this size begins there")                                                      \
    COMMRAM_CHECK(!commram_bound_##name || sizeof(type) > 8 || commram_whole_##name || sizeof(type) == (size),   \
                  name, "the type has another width than the address")                                           \
    COMMRAM_CHECK(!commram_bound_##name || commram_whole_##name || commram_place_##name % (size) == 0, name,     \
                  "the address is not divisible by the width")                                                   \
    COMMRAM_CHECK(!commram_bound_##name || COMMRAM_IN_AREA(commram_place_##name), name,                          \
                  "the address lies in no area of the device")                                                   \
    COMMRAM_CHECK(!commram_bound_##name || commram_whole_##name || commram_widths_##name == 0                    \
                      || ((unsigned)commram_widths_##name & (size)) != 0u, name,                                 \
                  "the register there has another width")                                                        \
    static type commram_own_##name;                                                                              \
    type *name = commram_bound_##name ? (type *)(void *)(commram_matiec_ram + commram_place_##name)              \
                                      : &commram_own_##name;
#define COMMRAM_CHECK(condition, name, text) COMMRAM_ASSERT(condition, #name ": " text);

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
        mmap(commram_matiec_ram, COMMRAM_SEGMENT_SIZE, PROT_READ | PROT_WRITE,
             MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0);
        close(file);
    }
    return result;
}

/* Puts memory of this process, all zero, in the image's place; the variables stay usable. */
static inline void commram_matiec_detach(commram *ram)
{
    mmap(commram_matiec_ram, COMMRAM_SEGMENT_SIZE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED,
         -1, 0);
    ram->base = NULL;
    commram_detach(ram);
}

#ifdef COMMRAM_MATIEC_ACCESS
/*
 * matiec's own pointers are not volatile: of two writes to a register in one scan an optimizing compiler drops the
 * first, and it may read a register once for many uses. Here they are.
 */
#include "accessor.h"
#undef __DECLARE_LOCATED
#undef __DECLARE_EXTERNAL
#define COMMRAM_POINTER(type, name)                                                                              \
    struct {                                                                                                     \
        volatile type *value;                                                                                    \
        IEC_BYTE flags;                                                                                          \
        type fvalue;                                                                                             \
    } name;
#define __DECLARE_LOCATED(type, name) COMMRAM_POINTER(type, name)
#define __DECLARE_EXTERNAL(type, name) COMMRAM_POINTER(type, name)
#endif

#endif
