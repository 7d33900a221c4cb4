/* Stand-in for the file of this name in matiec's runtime library: what this test's program needs of it. */
#ifndef ACCESSOR_H
#define ACCESSOR_H

#define __DECLARE_LOCATED(type, name) __IEC_##type##_p name;
#define __DECLARE_EXTERNAL(type, name) __IEC_##type##_p name;
#define __INIT_LOCATED(type, location, name, retained) \
    { extern type *location; name.value = location; name.flags |= retained ? 4 : 0; }
#define __INIT_LOCATED_VALUE(name, initial) *(name.value) = initial;
#define __GET_LOCATED(name, ...) ((*(name.value)) __VA_ARGS__)
#define __SET_LOCATED(prefix, name, suffix, new_value) \
    if (!(prefix name.flags & 2)) (*(prefix name.value)) suffix = new_value

#endif
