/* Functions by the versions that glibc has had from the beginning, so that a library made here runs with glibc 2.14
 * (2011) and newer. Without this, exp, log and pow ask for 2.29, fmod for 2.38 and dlopen for 2.34. Their results
 * are the same; the older versions also set errno. Programs that load libraries at all have dlopen, wherever their
 * glibc keeps it. To be included after a header of the standard library. */
#ifndef YAWBENCH_OLDEST_GLIBC_H
#define YAWBENCH_OLDEST_GLIBC_H

#if defined __GLIBC__ && defined __x86_64__
#define AS_EVER(name) __asm__(".symver " #name "," #name "@GLIBC_2.2.5");
AS_EVER(exp)
AS_EVER(exp2)
AS_EVER(log)
AS_EVER(log2)
AS_EVER(pow)
AS_EVER(fmod)
AS_EVER(hypot)
AS_EVER(dladdr)
AS_EVER(dlclose)
AS_EVER(dlerror)
AS_EVER(dlopen)
AS_EVER(dlsym)
#undef AS_EVER
#endif

#endif
