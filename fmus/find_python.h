/* Provides a Python interpreter: that of the process, or libpython, which is loaded and started. */
#ifndef YAWBENCH_FIND_PYTHON_H
#define YAWBENCH_FIND_PYTHON_H

#include <dlfcn.h>
#include <limits.h>
#include <link.h>
#include <locale.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { OLDEST_PYTHON = 10, NEWEST_TESTED_PYTHON = 13, NEWEST_PYTHON = 19 };

/* Functions of Python's C API that the launcher calls. */
typedef struct {
    int (*Py_IsInitialized)(void);
    void (*Py_InitializeEx)(int with_signal_handlers);
    const char *(*Py_GetVersion)(void);
    void *(*PyEval_SaveThread)(void);
    int (*PyGILState_Ensure)(void);
    void (*PyGILState_Release)(int);
    ptrdiff_t (*PyDict_Size)(void *);
} Python;

typedef struct {
    char **names;
    size_t count;
} Libraries;

/* Only collect names here: the loader is locked, so opening a library could deadlock. */
static int note_library(struct dl_phdr_info *info, size_t size, void *data)
{
    (void)size;
    Libraries *found = data;
    if (info->dlpi_name == NULL || info->dlpi_name[0] == '\0') {
        return 0;
    }
    char **names = realloc(found->names, (found->count + 1) * sizeof *names);
    if (names == NULL) {
        return 1;
    }
    found->names = names;
    names[found->count] = strdup(info->dlpi_name);
    if (names[found->count] != NULL) {
        found->count++;
    }
    return 0;
}

/* Make the symbols of a Python that was loaded with local symbols global; false if there is none. */
static bool promote_loaded_python(void)
{
    Libraries loaded = {NULL, 0};
    bool promoted = false;
    dl_iterate_phdr(note_library, &loaded);
    for (size_t i = 0; i < loaded.count; i++) {
        void *library = promoted ? NULL : dlopen(loaded.names[i], RTLD_LAZY | RTLD_NOLOAD);
        if (library != NULL) {
            Dl_info owner;
            void *symbol = dlsym(library, "Py_IsInitialized");
            promoted = symbol != NULL && dladdr(symbol, &owner) != 0 &&
                       dlopen(owner.dli_fname, RTLD_NOW | RTLD_NOLOAD | RTLD_GLOBAL) != NULL;
            dlclose(library);
        }
        free(loaded.names[i]);
    }
    free(loaded.names);
    return promoted;
}

static bool exists(const char *format, ...)
{
    char path[PATH_MAX];
    va_list values;
    va_start(values, format);
    int length = vsnprintf(path, sizeof path, format, values);
    va_end(values);
    return length > 0 && (size_t)length < sizeof path && access(path, R_OK) == 0;
}

/* Remove the last component of `path`; false if nothing would be left. */
static bool to_parent(char *path)
{
    char *slash = strrchr(path, '/');
    if (slash == NULL || slash == path) {
        return false;
    }
    *slash = '\0';
    return true;
}

/* Find the folder above the library `file` with the modules of Python 3.`minor`. */
static bool find_home(const char *file, int minor, char home[PATH_MAX])
{
    if (realpath(file, home) == NULL) {
        return false;
    }
    while (to_parent(home)) {
        if (exists("%s/lib/python3.%d/os.py", home, minor) ||
            exists("%s/lib64/python3.%d/os.py", home, minor)) {
            return true;
        }
    }
    return false;
}

static void *open_globally(const char *file)
{
    return dlopen(file, RTLD_NOW | RTLD_GLOBAL);
}

/* Open libpython3.`minor` from the loader's search path, or beside a python3 on PATH. */
static void *open_version(int minor)
{
    char file[PATH_MAX], binary[PATH_MAX], home[PATH_MAX];
    snprintf(file, sizeof file, "libpython3.%d.so.1.0", minor);
    void *library = open_globally(file);
    const char *path = getenv("PATH");
    while (library == NULL && path != NULL && *path != '\0') {
        int length = (int)strcspn(path, ":");
        int needed = snprintf(binary, sizeof binary, "%.*s/python3.%d", length, path, minor);
        if (length > 0 && needed < (int)sizeof binary && realpath(binary, home) != NULL && to_parent(home) &&
            to_parent(home)) {
            needed = snprintf(file, sizeof file, "%s/lib/libpython3.%d.so.1.0", home, minor);
            if (needed < (int)sizeof file && exists("%s", file)) {
                library = open_globally(file);
            }
        }
        path += length + (path[length] == ':');
    }
    return library;
}

/* Open a libpython with global symbols: Python's own extension modules need them. */
static bool open_python(char *problem, size_t size)
{
    const char *named = getenv("YAWBENCH_LIBPYTHON");
    if (named != NULL && *named != '\0') {
        if (open_globally(named) == NULL) {
            snprintf(problem, size, "YAWBENCH_LIBPYTHON names no library that can be opened: %s", dlerror());
            return false;
        }
        return true;
    }
    for (int minor = NEWEST_TESTED_PYTHON; minor >= OLDEST_PYTHON; minor--) {
        if (open_version(minor) != NULL) {
            return true;
        }
    }
    for (int minor = NEWEST_PYTHON; minor > NEWEST_TESTED_PYTHON; minor--) {
        if (open_version(minor) != NULL) {
            return true;
        }
    }
    snprintf(problem, size,
             "no Python found: install one with its shared library libpython3.%d.so.1.0 or newer, or let the "
             "environment variable YAWBENCH_LIBPYTHON name that file",
             OLDEST_PYTHON);
    return false;
}

/* True in the C locale, where Python reads file names as UTF-8, but an embedded Python does not. */
static bool is_plain_locale(void)
{
    const char *names[] = {"LC_ALL", "LC_CTYPE", "LANG"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        const char *locale = getenv(names[i]);
        if (locale != NULL && *locale != '\0') {
            return strcmp(locale, "C") == 0 || strcmp(locale, "POSIX") == 0;
        }
    }
    return true;
}

/* Start Python without signal handlers and release its lock.
 *
 * The launcher starts Python, not a PythonFMU library: the library that starts Python also ends it when
 * it is unloaded, while other FMUs use it. Ours runs until the process ends. Python's home is set
 * because Python would search for it from a python3 on PATH, which may be another installation. Python
 * sets the process's LC_CTYPE, which is restored for the host.
 */
static void start_python(const Python *python, int minor)
{
    static wchar_t home[PATH_MAX]; /* Python keeps the pointer */
    char folder[PATH_MAX];
    Dl_info owner;
    union {
        void *object;
        void (*call)(const wchar_t *);
        int (*function)(void);
    } symbol;
    symbol.function = python->Py_IsInitialized;
    if (dladdr(symbol.object, &owner) != 0 && find_home(owner.dli_fname, minor, folder)) {
        bool ascii = true;
        size_t i = 0;
        for (; folder[i] != '\0'; i++) {
            ascii = ascii && (unsigned char)folder[i] < 0x80;
            home[i] = (unsigned char)folder[i];
        }
        home[i] = L'\0';
        symbol.object = dlsym(RTLD_DEFAULT, "Py_SetPythonHome");
        if (ascii && symbol.object != NULL) {
            symbol.call(home);
        }
    }
    int *utf8_mode = dlsym(RTLD_DEFAULT, "Py_UTF8Mode");
    if (utf8_mode != NULL && is_plain_locale()) {
        *utf8_mode = 1;
    }
    const char *set = setlocale(LC_CTYPE, NULL);
    char *locale = set == NULL ? NULL : strdup(set);
    python->Py_InitializeEx(0);
    if (locale != NULL) {
        setlocale(LC_CTYPE, locale);
    }
    free(locale);
    python->PyEval_SaveThread();
}

/* Find or start Python; false with a sentence in `problem` if there is none. */
static bool provide_python(Python *python, char *problem, size_t size)
{
    if (dlsym(RTLD_DEFAULT, "Py_IsInitialized") == NULL && !promote_loaded_python() &&
        !open_python(problem, size)) {
        return false;
    }
    const struct {
        const char *name;
        void *slot;
    } functions[] = {
        {"Py_IsInitialized", &python->Py_IsInitialized},
        {"Py_InitializeEx", &python->Py_InitializeEx},
        {"Py_GetVersion", &python->Py_GetVersion},
        {"PyEval_SaveThread", &python->PyEval_SaveThread},
        {"PyGILState_Ensure", &python->PyGILState_Ensure},
        {"PyGILState_Release", &python->PyGILState_Release},
        {"PyDict_Size", &python->PyDict_Size},
    };
    for (size_t i = 0; i < sizeof functions / sizeof *functions; i++) {
        void *symbol = dlsym(RTLD_DEFAULT, functions[i].name);
        if (symbol == NULL) {
            snprintf(problem, size, "the Python in this process is not usable: %s is missing",
                     functions[i].name);
            return false;
        }
        memcpy(functions[i].slot, &symbol, sizeof symbol);
    }
    const char *version = python->Py_GetVersion();
    int minor = 0;
    for (const char *c = version + 2; *c >= '0' && *c <= '9'; c++) {
        minor = 10 * minor + (*c - '0');
    }
    if (strncmp(version, "3.", 2) != 0 || minor < OLDEST_PYTHON) {
        snprintf(problem, size, "Python 3.%d or newer is needed, this process has Python %.*s",
                 OLDEST_PYTHON, (int)strcspn(version, " "), version);
        return false;
    }
    /* Two threads may load FMUs at once; the lock of stderr is shared by all libraries. */
    flockfile(stderr);
    if (!python->Py_IsInitialized()) {
        start_python(python, minor);
    }
    funlockfile(stderr);
    return true;
}

#endif
