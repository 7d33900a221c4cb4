// Stub of STruC++'s header of this name; commram_strucpp.h has its class.
#ifndef STRUCPP_IEC_GLOBAL_HPP
#error commram_strucpp.h must come first
#endif
