/* Levels of 0 behind an address are other spellings of it: %MB3.200012.0. */
#define COMMRAM_IS_NO_LEVEL(n) ((n) == 0u || (n) == COMMRAM_NO_NUMBER)

/*
 * What a located variable has to keep to if the device has its address (`bound`). `rule` gets each condition, the name and
 * what is wrong if it does not hold. `whole`: a structure of this size begins there; `levels`: only 0 stands in further
 * levels; `widths`: of the registers there, added up; `bit`: the number of the bit if it is one of a flag.
 */
#define COMMRAM_RULES(rule, name, bound, is_bit, size, levels, bytes, whole, place, widths, bit)                 \
    rule(!(bound) || (is_bit) != 2 || (bit) != COMMRAM_NO_NUMBER, name,                                          \
         "an address without a size is that of a bit; write %MB, %MW or %MD")                                    \
    rule(!(bound) || COMMRAM_IN_AREA(place), name, "the address is not in any area of the device")                  \
    rule(!(bound) || !(is_bit) || (bit) != COMMRAM_NO_NUMBER, name,                                              \
         "a single bit has no separate address; locate the byte")                                                \
    rule(!(bound) || (is_bit) || (levels), name, "the address has levels too many; only 0 is allowed there")     \
    rule(!(bound) || (bytes) <= 8 || (whole), name, "no structure of this size begins there")                    \
    rule(!(bound) || (bytes) > 8 || (whole) || (bytes) == (size), name,                                          \
         "the type has another width than the address")                                                          \
    rule(!(bound) || (whole) || (place) % (size) == 0, name, "the address is not divisible by the width")        \
    rule(!(bound) || (whole) || (widths) == 0 || ((unsigned)(widths) & (size)) != 0u, name,                      \
         "the register there has another width")


/* Bits of flags are reached by the macros of accessor.h, where these are the ones below. */
#if defined(COMMRAM_MATIEC_ACCESS) || defined(COMMRAM_MATIEC_BY_NAME) || defined(__cplusplus)
#define COMMRAM_REACHED_BIT(place, bit) COMMRAM_FLAG_BIT(place, bit)
#else
#define COMMRAM_REACHED_BIT(place, bit) COMMRAM_NO_NUMBER
#endif
