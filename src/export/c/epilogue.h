
#ifdef __cplusplus
}
#undef _Static_assert
#endif

#endif
