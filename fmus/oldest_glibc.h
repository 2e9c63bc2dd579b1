/* Binds functions to their oldest symbol versions in glibc, so that libraries built here run with glibc 2.14 (2011)
 * and newer. Otherwise exp, log and pow require 2.29, fmod 2.38 and dlopen 2.34. Results are the same; the older
 * versions also set errno. Programs that load libraries have dlopen, in whichever library of their glibc. Include
 * this after a header of the standard library. */
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
