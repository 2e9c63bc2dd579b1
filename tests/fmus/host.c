/* A plain FMI 2.0 host without any Python: two instances, ten steps, the state saved and restored.
 *
 *     host LIBRARY RESOURCES GUID FIRST_OUTPUT N_REALS [REFERENCE=VALUE ...]
 *
 * Prints the name of every logged message to stderr and all Real values after ten steps of 1 ms to
 * stdout. The process's locale must stay what it was. Exit status 0 if everything answered as the standard says, 1 if not, 2 if the library
 * cannot be loaded, 3 if it cannot be instantiated.
 */
#define _GNU_SOURCE

#include <dlfcn.h>
#include <locale.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2.h"

#define MAX_REALS 512
#define MAX_BYTES (1 << 20)

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                   fmi2String category, fmi2String message, ...)
{
    (void)environment;
    va_list values;
    va_start(values, message);
    fprintf(stderr, "[%s] %d %s: ", instance, (int)status, category);
    vfprintf(stderr, message, values);
    fprintf(stderr, "\n");
    va_end(values);
}

static void *library;

static void *function(const char *name)
{
    void *symbol = dlsym(library, name);
    if (symbol == NULL) {
        fprintf(stderr, "no function %s\n", name);
        exit(2);
    }
    return symbol;
}

static void check(int right, const char *what)
{
    if (!right) {
        fprintf(stderr, "wrong: %s\n", what);
        exit(1);
    }
}

#define CALL(name, ...)                                                                                      \
    do {                                                                                                     \
        fmi2##name##Fn call;                                                                                 \
        void *symbol = function("fmi2" #name);                                                               \
        memcpy(&call, &symbol, sizeof symbol);                                                               \
        check(call(__VA_ARGS__) == fmi2OK, "fmi2" #name);                                                    \
    } while (0)

static void step(fmi2Component unit, int k)
{
    CALL(DoStep, unit, 0.001 * k, 0.001, fmi2True);
}

static void read_all(fmi2Component unit, size_t n, double values[])
{
    fmi2ValueReference vr[MAX_REALS];
    for (size_t i = 0; i < n; i++) {
        vr[i] = (fmi2ValueReference)i;
    }
    CALL(GetReal, unit, vr, n, values);
}

static fmi2Component prepare(fmi2InstantiateFn instantiate, char *argv[], int argc, const char *name,
                             const fmi2CallbackFunctions *callbacks)
{
    fmi2Component unit =
        instantiate(name, fmi2CoSimulation, argv[3], argv[2], callbacks, fmi2False, fmi2False);
    if (unit == NULL) {
        exit(3);
    }
    CALL(SetupExperiment, unit, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    for (int i = 6; i < argc; i++) {
        fmi2ValueReference vr = (fmi2ValueReference)strtoul(argv[i], NULL, 10);
        double value = strtod(strchr(argv[i], '=') + 1, NULL);
        CALL(SetReal, unit, &vr, 1, &value);
    }
    CALL(EnterInitializationMode, unit);
    CALL(ExitInitializationMode, unit);
    return unit;
}

int main(int argc, char *argv[])
{
    static double before[MAX_REALS], after[MAX_REALS], again[MAX_REALS];
    static char bytes[MAX_BYTES];
    if (argc < 6 || (library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL)) == NULL) {
        fprintf(stderr, "%s\n", argc < 6 ? "too few arguments" : dlerror());
        return 2;
    }
    size_t n = (size_t)atoi(argv[5]);
    check(n <= MAX_REALS, "too many Reals");
    fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2InstantiateFn instantiate;
    fmi2FreeInstanceFn free_instance;
    void *symbol = function("fmi2Instantiate");
    memcpy(&instantiate, &symbol, sizeof symbol);
    symbol = function("fmi2FreeInstance");
    memcpy(&free_instance, &symbol, sizeof symbol);

    char locale[256];
    snprintf(locale, sizeof locale, "%s", setlocale(LC_ALL, NULL));
    fmi2Component first = prepare(instantiate, argv, argc, "first", &callbacks);
    fmi2Component second = prepare(instantiate, argv, argc, "second", &callbacks);
    for (int k = 0; k < 10; k++) {
        step(first, k);
    }
    read_all(first, n, before);

    fmi2FMUstate state = NULL, copy = NULL;
    size_t size = 0;
    CALL(GetFMUstate, first, &state);
    CALL(SerializedFMUstateSize, first, state, &size);
    check(size > 0 && size <= MAX_BYTES, "size of the state");
    CALL(SerializeFMUstate, first, state, bytes, size);
    step(first, 10);
    read_all(first, n, after);
    CALL(SetFMUstate, first, state);
    read_all(first, n, again);
    check(memcmp(before, again, n * sizeof *again) == 0, "the state restored");
    step(first, 10);
    read_all(first, n, again);
    check(memcmp(after, again, n * sizeof *again) == 0, "the step repeated");
    CALL(DeSerializeFMUstate, second, bytes, size, &copy);
    CALL(SetFMUstate, second, copy);
    step(second, 10);
    read_all(second, n, again);
    check(memcmp(after, again, n * sizeof *again) == 0, "the step in the other instance");
    CALL(FreeFMUstate, first, &state);
    CALL(FreeFMUstate, second, &copy);
    check(state == NULL && copy == NULL, "states freed");

    check(strcmp(locale, setlocale(LC_ALL, NULL)) == 0, "the locale untouched");
    CALL(Reset, first);
    CALL(Terminate, second);
    for (size_t i = 0; i < n; i++) {
        printf("%.17g\n", before[i]);
    }
    free_instance(first);
    free_instance(second);
    dlclose(library);
    return 0;
}
