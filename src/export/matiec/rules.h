/* An address with further levels of 0, such as %MB3.200012.0, is another spelling of the address without them. */
#define COMMRAM_IS_NO_LEVEL(n) ((n) == 0u || (n) == COMMRAM_NO_NUMBER)

/*
 * Rules for a located variable, if the device has its address (`bound`). `rule` is called with each condition, the
 * name, and the error if the condition does not hold. `whole`: size of the structure that begins at the address;
 * `levels`: true if all further levels are 0; `widths`: sum of the widths of the registers at the address; `bit`:
 * number of the bit, if it belongs to a flag.
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


/* A program can access bits of flags only if the macros of accessor.h are replaced by those of commram. */
#if defined(COMMRAM_MATIEC_ACCESS) || defined(COMMRAM_MATIEC_BY_NAME) || defined(__cplusplus)
#define COMMRAM_REACHED_BIT(place, bit) COMMRAM_FLAG_BIT(place, bit)
#else
#define COMMRAM_REACHED_BIT(place, bit) COMMRAM_NO_NUMBER
#endif
