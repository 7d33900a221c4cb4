 *
 * Registers under the global variables of a program that STruC++ compiled; every file of the program includes this header
 * first: g++ -std=c++17 -include commram_strucpp.h. docs/guide/openplc-4.md describes the use.
 */
#ifndef COMMRAM_STRUCPP_H
#define COMMRAM_STRUCPP_H

#include <cstdint>
#include <functional>
#include <new>

#include "iec_located.hpp"
#include "iec_var.hpp"

/* In place of the class in STruC++'s iec_global.hpp, whose variables are memory of the program. */
#define STRUCPP_IEC_GLOBAL_HPP

namespace strucpp {

/* STruC++'s descriptor of a located variable, with numbers as large as those of the addresses. */
struct commram_located_var {
    LocatedArea area;
    LocatedSize size;
    uint32_t byte_index;
    uint32_t bit_index;
    uint8_t reserved[3];
    void *pointer;
};

/* A global variable of any type; the list of all. */
class commram_global {
  public:
    static inline commram_global *first = nullptr;
    commram_global *const next;
    /* Where the program's own value is. */
    const void *const own;
    /* The register under the variable, in memory that an image is mapped over; null if there is none. */
    volatile unsigned char *at = nullptr;
    /* The bit of the byte at `at`, if the variable is one. */
    unsigned char mask = 0;

    /* Gives the program's own value its initial value. */
    virtual void begin() = 0;
    /* Writes the program's own value where the register is. */
    virtual void give_initial_value() = 0;

  protected:
    explicit commram_global(const void *own) : next(first), own(own) { first = this; }
    ~commram_global() = default;
};

/* The type of a register under a variable of type V; void if there can be none. */
template <typename V> struct commram_raw {
    typedef void type;
};
template <typename T> struct commram_raw<IECVar<T>> {
    typedef T type;
};

/* One access of the register's width. Of bits that share a byte only this one changes. */
template <typename T> T commram_load(volatile unsigned char *at, unsigned char mask)
{
    if (mask)
        return T((*at & mask) != 0);
    return *reinterpret_cast<volatile T *>(at);
}

template <typename T> void commram_store(volatile unsigned char *at, unsigned char mask, T value)
{
    if (!mask)
        *reinterpret_cast<volatile T *>(at) = value;
    else if (value)
        __atomic_fetch_or(at, mask, __ATOMIC_SEQ_CST);
    else
        __atomic_fetch_and(at, static_cast<unsigned char>(~mask), __ATOMIC_SEQ_CST);
}

template <typename V> class GlobalVar : public commram_global {
    typedef typename commram_raw<V>::type raw;
    static constexpr bool can_be_register = !std::is_void<raw>::value;
    std::function<void(V *)> construct;

    /* A forced variable keeps its value, and its register what it holds. */
    bool is_register() const
    {
        if constexpr (can_be_register)
            return at && !value.is_forced();
        return false;
    }

  public:
    V value;

    GlobalVar() : commram_global(&value), construct([](V *place) { new (place) V(); }), value() {}
    template <typename T>
    explicit GlobalVar(T initial)
        : commram_global(&value), construct([initial](V *place) { new (place) V(initial); }), value(initial)
    {
    }
    GlobalVar(const GlobalVar &) = delete;
    GlobalVar &operator=(const GlobalVar &) = delete;

    void begin() override
    {
        value.~V();
        construct(&value);
    }

    void give_initial_value() override
    {
        if constexpr (can_be_register)
            commram_store<raw>(at, mask, value.get());
    }

    auto read() const
    {
        if constexpr (can_be_register) {
            if (is_register())
                return commram_load<raw>(at, mask);
        }
        return value.get();
    }

    template <typename T> void write(T written)
    {
        if constexpr (can_be_register) {
            if (is_register())
                return commram_store<raw>(at, mask, static_cast<raw>(written));
        }
        value.set(written);
    }

    /* For parts of structures and arrays, and calls of function blocks. A register is read before, and written after a change. */
    template <typename F> auto with_lock(F &&use) -> decltype(use(static_cast<V *>(nullptr)))
    {
        struct Register {
            GlobalVar *variable;
            V before;
            ~Register()
            {
                if constexpr (can_be_register) {
                    if (variable->is_register() && variable->value.get() != before.get())
                        variable->give_initial_value();
                }
            }
        };
        if constexpr (can_be_register) {
            if (is_register())
                value.set(commram_load<raw>(at, mask));
            Register copied{this, value};
            return use(&value);
        } else {
            return use(&value);
        }
    }
};

} // namespace strucpp

#define LocatedVar commram_located_var
#endif
