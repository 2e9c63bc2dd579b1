/* Conversion of text between hosts, PythonFMU's library and Python. */
#ifndef YAWBENCH_TEXT_H
#define YAWBENCH_TEXT_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Return a copy of `text` with every '%' doubled (log text is a printf format), or NULL. */
static char *double_percent(const char *text)
{
    size_t length = strlen(text);
    char *copy = malloc(2 * length + 1), *end = copy;
    if (copy == NULL) {
        return NULL;
    }
    for (; *text != '\0'; text++) {
        *end++ = *text;
        if (*text == '%') {
            *end++ = '%';
        }
    }
    *end = '\0';
    return copy;
}

/* Python creates strings only from UTF-8, and PythonFMU's library does not check. */
static bool is_utf8(const char *text)
{
    const unsigned char *c = (const unsigned char *)text;
    while (*c != '\0') {
        int more = *c < 0x80 ? 0 : *c >= 0xF0 ? 3 : *c >= 0xE0 ? 2 : 1;
        unsigned long point = more == 0 ? *c : *c & (0x3FU >> more);
        if (*c > 0xF4 || (*c >= 0x80 && *c < 0xC2)) {
            return false;
        }
        c++;
        for (int i = 0; i < more; i++, c++) {
            if ((*c & 0xC0) != 0x80) {
                return false;
            }
            point = point << 6 | (*c & 0x3FU);
        }
        if ((more == 2 && (point < 0x800 || (point >= 0xD800 && point <= 0xDFFF))) ||
            (more == 3 && (point < 0x10000 || point > 0x10FFFF))) {
            return false;
        }
    }
    return true;
}

static int hex_digit(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/* Return the path in a location: file:///p, file://host/p, file:/p or a plain path. */
static const char *without_scheme(const char *location)
{
    if (strncasecmp(location, "file:", 5) != 0) {
        return location;
    }
    location += 5;
    if (strncmp(location, "//", 2) == 0) {
        const char *path = strchr(location + 2, '/');
        return path != NULL ? path : location + 2;
    }
    return location;
}

/* Decode every %XX in `text`; %00 and invalid sequences are kept. */
static void decode_percent(char *text)
{
    char *end = text;
    for (; *text != '\0'; text++) {
        if (*text == '%' && hex_digit(text[1]) >= 0 && hex_digit(text[2]) >= 0 &&
            (text[1] != '0' || text[2] != '0')) {
            *end++ = (char)(hex_digit(text[1]) << 4 | hex_digit(text[2]));
            text += 2;
        } else {
            *end++ = *text;
        }
    }
    *end = '\0';
}

/* Return `path` encoded for PythonFMU's library, or NULL if that is impossible.
 *
 * The library turns each "%20" into a space, then removes the first "file://". It decodes nothing else,
 * so a folder with the actual name "a%20b" is passed as "a%file://20b".
 */
static char *spelled_for_pythonfmu(const char *path)
{
    const char *trap = strstr(path, "%20");
    if (trap == NULL) {
        return strstr(path, "file://") == NULL ? strdup(path) : NULL;
    }
    if (strstr(trap + 1, "%20") != NULL) {
        return NULL;
    }
    size_t size = strlen(path) + sizeof "file://";
    char *spelled = malloc(size);
    if (spelled != NULL) {
        snprintf(spelled, size, "%.*s%%file://%s", (int)(trap - path), path, trap + 1);
    }
    return spelled;
}

#endif
