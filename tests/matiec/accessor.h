/* Stand-in for the file of this name in matiec's runtime library: what this test's program needs of it. */
#ifndef ACCESSOR_H
#define ACCESSOR_H

#define __DECLARE_LOCATED(type, name) __IEC_##type##_p name;
#define __DECLARE_EXTERNAL(type, name) __IEC_##type##_p name;
#define __INIT_LOCATED(type, location, name) { extern type *location; name.value = location; }
#define __INIT_LOCATED_VALUE(name, initial) *(name.value) = initial;
#define __GET_LOCATED(name) ((name.flags & 2) ? name.fvalue : *(name.value))
#define __SET_LOCATED(prefix, name, new_value) if (!(prefix name.flags & 2)) *(prefix name.value) = new_value

#endif
