/*
 * In this file the pointers to located variables are volatile. matiec's own pointers are not: an optimizing compiler
 * could drop the first of two writes to a register in one scan, or read a register once for many uses.
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

/*
 * 1 during a warm start, in which variables that are declared RETAIN keep their values (5.00005.03a p. 38); otherwise
 * 0.
 */
extern int commram_matiec_keeps_retain;
#undef __INIT_VAR
#undef __INIT_GLOBAL
#define __INIT_VAR(name, initial, retained)                                                                      \
    if (!((retained) && commram_matiec_keeps_retain))                                                            \
        name.value = initial;                                                                                    \
    name.flags |= (retained) ? __IEC_RETAIN_FLAG : 0;
#define __INIT_GLOBAL(type, name, initial, retained)                                                             \
    {                                                                                                            \
        if (!((retained) && commram_matiec_keeps_retain)) {                                                      \
            type commram_temp = initial;                                                                         \
            __INIT_GLOBAL_##name(commram_temp);                                                                  \
        }                                                                                                        \
        (*GLOBAL__##name).flags |= (retained) ? __IEC_RETAIN_FLAG : 0;                                           \
    }

/*
 * C has no address of a bit. So a variable that is located at a bit of a flag has a byte here. Each read copies the bit
 * to the byte, and each write copies the byte to the bit.
 */
extern unsigned char commram_matiec_ram[COMMRAM_MATIEC_BYTES];
extern unsigned char commram_matiec_bits[COMMRAM_FLAG_BITS];

static inline size_t commram_matiec_bit(volatile void *at)
{
    return (size_t)((uintptr_t)at - (uintptr_t)commram_matiec_bits);
}

static inline volatile unsigned char *commram_matiec_flag(size_t bit)
{
    size_t flag = bit / 8u;
    (void)flag;
    return commram_matiec_ram + COMMRAM_FLAG_BYTE(flag);
}

static inline volatile void *commram_matiec_seen(volatile void *at)
{
    size_t bit = commram_matiec_bit(at);
    if (bit < sizeof commram_matiec_bits)
        commram_matiec_bits[bit] = *commram_matiec_flag(bit) >> bit % 8u & 1u;
    return at;
}

static inline void commram_matiec_stored(volatile void *at)
{
    size_t bit = commram_matiec_bit(at);
    unsigned char mask = (unsigned char)(1u << bit % 8u);
    if (bit >= sizeof commram_matiec_bits)
        return;
    if (commram_matiec_bits[bit])
        __atomic_fetch_or(commram_matiec_flag(bit), mask, __ATOMIC_SEQ_CST);
    else
        __atomic_fetch_and(commram_matiec_flag(bit), (unsigned char)~mask, __ATOMIC_SEQ_CST);
}

#undef __GET_LOCATED
#undef __GET_EXTERNAL
#undef __GET_LOCATED_BY_REF
#undef __GET_EXTERNAL_BY_REF
#undef __SET_LOCATED
#undef __SET_EXTERNAL
#define COMMRAM_SEEN(name) (*(__typeof__(name.value))commram_matiec_seen(name.value))
#define __GET_LOCATED(name, ...) (COMMRAM_SEEN(name) __VA_ARGS__)
#define __GET_EXTERNAL(name, ...) (COMMRAM_SEEN(name) __VA_ARGS__)
#define __GET_LOCATED_BY_REF(name, ...) (&(COMMRAM_SEEN(name) __VA_ARGS__))
#define __GET_EXTERNAL_BY_REF(name, ...) (&(COMMRAM_SEEN(name) __VA_ARGS__))
#define COMMRAM_STORE_INTO(prefix, name, suffix, new_value)                                                      \
    {                                                                                                            \
        (*(prefix name.value)) suffix = new_value;                                                               \
        commram_matiec_stored(prefix name.value);                                                                \
    }
#define __SET_LOCATED(prefix, name, suffix, new_value)                                                           \
    if (!(prefix name.flags & __IEC_FORCE_FLAG))                                                                 \
        COMMRAM_STORE_INTO(prefix, name, suffix, new_value)
#define __SET_EXTERNAL(prefix, name, suffix, new_value)                                                          \
    {                                                                                                            \
        extern IEC_BYTE __IS_GLOBAL_##name##_FORCED(void);                                                       \
        if (!(prefix name.flags & __IEC_FORCE_FLAG || __IS_GLOBAL_##name##_FORCED()))                            \
            COMMRAM_STORE_INTO(prefix, name, suffix, new_value)                                                  \
    }
