/*
 * How to use it: docs/reference/export.md. In short, one C file of the application, `commram export matiec --main`, has
 *
 *     #include "iec_std_lib.h"
 *     #include "commram_matiec.h"
 *     #include "POUS.h"
 *     COMMRAM_MATIEC_STORAGE
 *     #include "commram_located.h"
 *
 * where commram_located.h has the entries of matiec's LOCATED_VARIABLES.h. It omits the names of other variables that
 * matiec writes between the entries, line ends, and repeated lines:
 *
 *     grep -o '__LOCATED_VAR([^)]*)' LOCATED_VARIABLES.h | sort -u > commram_located.h
 *
 * All files are compiled with -DCOMMRAM_MATIEC_ACCESS -include commram_matiec.h. If no step can make commram_located.h
 * between matiec and the C compiler, as in Beremiz, use -DCOMMRAM_MATIEC_BY_NAME -include commram_matiec.h and leave out
 * commram_located.h.
 */

/*
 * unistd.h defines macros of these names for access(). Most function blocks have a pin x_OK, and matiec writes its name
 * in capitals, so the macro would replace it.
 */
#undef F_OK
#undef R_OK
#undef W_OK
#undef X_OK

/* An address without a letter for the size, such as %M3.200012, is the address of a bit. matiec calls this size S. */
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

/*
 * The entries of commram_located.h: one for each address, with one to six numbers, as in %MB3.200012, %QX0.1 or %MW7.
 */
#define __LOCATED_VAR(type, name, area, size, ...)                                                               \
    COMMRAM_SPELLED(type, name, COMMRAM_LETTER_##area, COMMRAM_IS_BIT_##size, COMMRAM_SIZE_##size, __VA_ARGS__,  \
                    4294967295, 4294967295, 4294967295, 4294967295, 4294967295, 4294967295, )
/* A number with a leading 0, %QX0.08, is decimal, although it would be octal in C. 4294967295 is COMMRAM_NO_NUMBER. */
#define COMMRAM_SPELLED(type, name, letter, is_bit, size, a, b, c, d, e, f, ...)                                 \
    COMMRAM_LOCATED(type, name, letter, is_bit, size, COMMRAM_DECIMAL(0x##a##ull), COMMRAM_DECIMAL(0x##b##ull),  \
                    COMMRAM_DECIMAL(0x##c##ull), COMMRAM_DECIMAL(0x##d##ull), COMMRAM_DECIMAL(0x##e##ull),       \
                    COMMRAM_DECIMAL(0x##f##ull))
#define COMMRAM_DIGIT(n, at) ((unsigned)((n) >> 4u * (at)) & 15u)
#define COMMRAM_DECIMAL(n)                                                                                       \
    (COMMRAM_DIGIT(n, 0u) + COMMRAM_DIGIT(n, 1u) * 10u + COMMRAM_DIGIT(n, 2u) * 100u                             \
     + COMMRAM_DIGIT(n, 3u) * 1000u + COMMRAM_DIGIT(n, 4u) * 10000u + COMMRAM_DIGIT(n, 5u) * 100000u             \
     + COMMRAM_DIGIT(n, 6u) * 1000000u + COMMRAM_DIGIT(n, 7u) * 10000000u + COMMRAM_DIGIT(n, 8u) * 100000000u    \
     + COMMRAM_DIGIT(n, 9u) * 1000000000u)
#define COMMRAM_LOCATED(type, name, letter, is_bit, size, a, b, c, d, e, f)                                      \
    enum {                                                                                                       \
        commram_bound_##name = COMMRAM_IN_RAM(letter, is_bit, size, a, b),                                       \
        commram_place_##name = COMMRAM_PLACE(letter, is_bit, size, a, b)                                         \
    };                                                                                                           \
    enum { commram_bit_##name = (is_bit) ? (int)COMMRAM_REACHED_BIT((unsigned)commram_place_##name, b) : -1 };  \
    enum {                                                                                                       \
        commram_whole_##name = COMMRAM_STRUCTURE_AT(commram_place_##name, sizeof(type)),                         \
        commram_widths_##name = COMMRAM_WIDTHS_AT(commram_place_##name)                                          \
    };                                                                                                           \
    COMMRAM_RULES(COMMRAM_CHECK, #name, commram_bound_##name, is_bit, size,                                      \
                  COMMRAM_IS_NO_LEVEL(c) && COMMRAM_IS_NO_LEVEL(d) && COMMRAM_IS_NO_LEVEL(e) && COMMRAM_IS_NO_LEVEL(f),\
                  sizeof(type), commram_whole_##name, commram_place_##name, commram_widths_##name,               \
                  (unsigned)commram_bit_##name)                                                                  \
    static type commram_own_##name;                                                                              \
    type *name = !commram_bound_##name     ? &commram_own_##name                                                 \
                 : commram_bit_##name >= 0 ? (type *)(void *)(commram_matiec_bits + commram_bit_##name)          \
                                           : (type *)(void *)(commram_matiec_ram + commram_place_##name);
#define COMMRAM_CHECK(condition, name, text) COMMRAM_ASSERT(condition, name ": " text);

