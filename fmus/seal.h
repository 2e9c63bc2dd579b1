/* Seal of a serialized state: a check sum of its bytes and of the FMU's GUID, appended to them. A state of another
 * FMU, a part of one, or damaged bytes are refused instead of restored. */
#ifndef YAWBENCH_SEAL_H
#define YAWBENCH_SEAL_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef uint64_t Seal;

/* FNV-1a. */
static inline Seal sum_of(Seal sum, const char *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        sum = (sum ^ (unsigned char)bytes[i]) * 0x100000001b3u;
    }
    return sum;
}

static inline Seal seal_of(const char *guid, const char *bytes, size_t size)
{
    return sum_of(sum_of(0xcbf29ce484222325u, guid, strlen(guid) + 1), bytes, size);
}

/* Append the seal to `size` bytes. */
static inline void seal(const char *guid, char *bytes, size_t size)
{
    Seal made = seal_of(guid, bytes, size);
    memcpy(bytes + size, &made, sizeof made);
}

/* 1 if the seal at the end of `size` bytes, which count it, is right. */
static inline int is_sealed(const char *guid, const char *bytes, size_t size)
{
    Seal found;
    if (size < sizeof found) {
        return 0;
    }
    memcpy(&found, bytes + size - sizeof found, sizeof found);
    return found == seal_of(guid, bytes, size - sizeof found);
}

#endif
