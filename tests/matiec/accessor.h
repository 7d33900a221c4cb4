/* Stub for the file of this name in matiec's runtime library: the parts that this test's program needs. */
#ifndef ACCESSOR_H
#define ACCESSOR_H

#define __DECLARE_VAR(type, name) __IEC_##type##_t name;
#define __DECLARE_LOCATED(type, name) __IEC_##type##_p name;
#define __DECLARE_EXTERNAL(type, name) __IEC_##type##_p name;
#define __DECLARE_GLOBAL_LOCATION(type, location) extern type *location;
#define __DECLARE_GLOBAL_LOCATED(type, resource, name)                                                           \
    __IEC_##type##_p resource##__##name;                                                                         \
    static __IEC_##type##_p *GLOBAL__##name = &(resource##__##name);                                             \
    type *__GET_GLOBAL_##name(void) { return (*GLOBAL__##name).value; }
#define __INIT_GLOBAL_LOCATED(domain, name, location, retained)                                                  \
    domain##__##name.value = location;                                                                           \
    domain##__##name.flags |= retained ? 4 : 0;
#define __INIT_EXTERNAL(type, global, name, retained)                                                            \
    {                                                                                                            \
        extern type *__GET_GLOBAL_##global(void);                                                                \
        name.value = __GET_GLOBAL_##global();                                                                    \
        name.flags |= retained ? 4 : 0;                                                                          \
    }
#define __INIT_VAR(name, initial, retained)                                                                      \
    name.value = initial;                                                                                        \
    name.flags |= retained ? 4 : 0;
#define __INIT_LOCATED(type, location, name, retained)                                                           \
    {                                                                                                            \
        extern type *location;                                                                                   \
        name.value = location;                                                                                   \
        name.flags |= retained ? 4 : 0;                                                                          \
    }
#define __INIT_LOCATED_VALUE(name, initial) *(name.value) = initial;
#define __GET_VAR(name, ...) name.value __VA_ARGS__
#define __GET_LOCATED(name, ...) ((*(name.value))__VA_ARGS__)
#define __GET_EXTERNAL(name, ...) ((*(name.value))__VA_ARGS__)
#define __SET_VAR(prefix, name, suffix, new_value)                                                               \
    if (!(prefix name.flags & 2)) prefix name.value suffix = new_value
#define __SET_LOCATED(prefix, name, suffix, new_value)                                                           \
    if (!(prefix name.flags & 2)) (*(prefix name.value)) suffix = new_value
#define __SET_EXTERNAL(prefix, name, suffix, new_value)                                                          \
    if (!(prefix name.flags & 2)) (*(prefix name.value)) suffix = new_value

#endif
