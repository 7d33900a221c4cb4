
#include <unordered_map>

/* The address of a located variable, as the program has it. */
struct commram_strucpp_address {
    char letter;
    int is_bit;
    unsigned size, a, b;
};

inline commram_strucpp_address commram_strucpp_address_of(const strucpp::commram_located_var &located)
{
    static const unsigned sizes[] = {1, 1, 2, 4, 8};
    unsigned a = located.byte_index, b = located.bit_index;
    const int is_bit = located.size == strucpp::LocatedSize::Bit;
    if (!is_bit && !b)
        b = COMMRAM_NO_NUMBER;
    /* A thousand more in the number of the segment is another spelling of the address (D-755). */
    else if (!is_bit)
        a %= 1000u;
    return {strucpp::area_to_char(located.area), is_bit, sizes[static_cast<unsigned>(located.size)], a, b};
}

/* What is wrong with an address of the device; null if nothing is. Other addresses are the program's own. */
#define COMMRAM_STRUCPP_RULE(condition, name, text) if (!(condition)) return text;
inline const char *commram_strucpp_refusal(const commram_strucpp_address &address, const void *global)
{
    const char letter = address.letter;
    const unsigned size = address.size, a = address.a, b = address.b;
    const int is_bit = address.is_bit;
    const bool bound = COMMRAM_IN_RAM(letter, is_bit, size, a, b);
    const unsigned place = COMMRAM_PLACE(letter, is_bit, size, a, b);
    const unsigned bit = is_bit ? COMMRAM_FLAG_BIT(place, b) : COMMRAM_NO_NUMBER;
    (void)letter, (void)size, (void)b;
    if (bound && !global)
        return "a register needs a variable in VAR_GLOBAL of the configuration";
    COMMRAM_RULES(COMMRAM_STRUCPP_RULE, "", bound, is_bit, size, true, size, false, place, COMMRAM_WIDTHS_AT(place), bit)
    return nullptr;
}

/* Puts a variable at its register, in memory that an image is mapped over. */
inline void commram_strucpp_put(const commram_strucpp_address &address, strucpp::commram_global *global)
{
    const char letter = address.letter;
    const unsigned size = address.size, a = address.a, b = address.b;
    const int is_bit = address.is_bit;
    unsigned place = COMMRAM_PLACE(letter, is_bit, size, a, b);
    (void)letter, (void)size, (void)b;
    if (!COMMRAM_IN_RAM(letter, is_bit, size, a, b))
        return;
    if (is_bit) {
        const unsigned bit = COMMRAM_FLAG_BIT(place, b);
        global->mask = static_cast<unsigned char>(1u << bit % 8u);
        place = COMMRAM_FLAG_BYTE(bit / 8u);
    }
    global->at = commram_matiec_ram + place;
}

/* Puts all located variables at their registers; returns false after a message if one is refused. */
template <unsigned count> bool commram_strucpp_bind(const strucpp::commram_located_var (&all)[count])
{
    std::unordered_map<const void *, strucpp::commram_global *> globals;
    for (strucpp::commram_global *global = strucpp::commram_global::first; global; global = global->next)
        globals[global->own] = global;
    for (const strucpp::commram_located_var &located : all) {
        const auto found = globals.find(located.pointer);
        strucpp::commram_global *global = found == globals.end() ? nullptr : found->second;
        const commram_strucpp_address address = commram_strucpp_address_of(located);
        if (const char *why = commram_strucpp_refusal(address, global)) {
            fprintf(stderr, "%%%c%c%u.%u: %s\n", address.letter, "XBWDL"[static_cast<unsigned>(located.size)],
                    located.byte_index, located.bit_index, why);
            return false;
        }
        if (global)
            commram_strucpp_put(address, global);
    }
    return true;
}
