/*
 * How to use it: docs/export.md. In short, one C file of the application has
 *
 *     #include "iec_std_lib.h"
 *     #include "commram_matiec.h"
 *     COMMRAM_MATIEC_STORAGE
 *     #include "LOCATED_VARIABLES.h"
 *
 * and the files that matiec made are compiled with -DCOMMRAM_MATIEC_ACCESS -include commram_matiec.h.
 */

/*
 * What matiec's variables point to. Until commram_matiec_attach maps the image over it, it is memory of this
 * process, so the initial values that config_init__ writes to every located variable never reach a register.
 */
#define COMMRAM_MATIEC_BYTES ((COMMRAM_SEGMENT_SIZE + 0xFFFFu) / 0x10000u * 0x10000u)
#define COMMRAM_MATIEC_STORAGE                                                                                   \
    unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES] __attribute__((aligned(0x10000)));
extern unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES];

#define COMMRAM_SIZE_X 1u
#define COMMRAM_SIZE_B 1u
#define COMMRAM_SIZE_W 2u
#define COMMRAM_SIZE_D 4u
#define COMMRAM_SIZE_L 8u
#define COMMRAM_IS_BIT_X 1
#define COMMRAM_IS_BIT_B 0
#define COMMRAM_IS_BIT_W 0
#define COMMRAM_IS_BIT_D 0
#define COMMRAM_IS_BIT_L 0
#define COMMRAM_LETTER_M 'M'
#define COMMRAM_LETTER_I 'I'
#define COMMRAM_LETTER_Q 'Q'

/* LOCATED_VARIABLES.h: one of these per address, with one to three numbers: %MB3.200012, %QX0.1, %MW7. */
#define __LOCATED_VAR(type, name, area, size, ...)                                                               \
    COMMRAM_LOCATED(type, name, COMMRAM_LETTER_##area, COMMRAM_IS_BIT_##size, COMMRAM_SIZE_##size, __VA_ARGS__,  \
                    COMMRAM_NO_NUMBER, COMMRAM_NO_NUMBER, )
#define COMMRAM_LOCATED(type, name, letter, is_bit, size, a, b, ...)                                             \
    enum {                                                                                                       \
        commram_bound_##name = COMMRAM_IN_RAM(letter, is_bit, size, a, b),                                       \
        commram_place_##name = COMMRAM_PLACE(letter, is_bit, size, a, b)                                         \
    };                                                                                                           \
    COMMRAM_CHECK(!commram_bound_##name || !(is_bit), name,                                                      \
                  "a single bit has no address of its own; locate the byte")                                     \
    COMMRAM_CHECK(!commram_bound_##name || sizeof(type) == (size), name,                                         \
                  "the type has another width than the address")                                                 \
    COMMRAM_CHECK(!commram_bound_##name || commram_place_##name % (size) == 0, name,                             \
                  "the address is not divisible by the width")                                                   \
    COMMRAM_CHECK(!commram_bound_##name || COMMRAM_IN_AREA(commram_place_##name), name,                          \
                  "the address lies in no area of the device")                                                   \
    COMMRAM_CHECK(!commram_bound_##name || COMMRAM_WIDTH_AT(commram_place_##name) == 0u                          \
                      || COMMRAM_WIDTH_AT(commram_place_##name) == (size), name,                                 \
                  "the register there has another width")                                                        \
    static type commram_own_##name;                                                                              \
    type *name = commram_bound_##name ? (type *)(void *)(commram_matiec_ram + commram_place_##name)              \
                                      : &commram_own_##name;
#define COMMRAM_CHECK(condition, name, text) _Static_assert(condition, #name ": " text);

/* Maps the image `path` over the storage. Call it after config_init__ and before the first scan. */
static inline commram_result commram_matiec_attach(commram *ram, const char *path)
{
    commram_result result;
    int file = open(path, O_RDWR | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
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
