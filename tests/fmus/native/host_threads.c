/* Fifty instances of a unit in fifty threads, then each once more alone: the same numbers.
 *
 *     host_threads LIBRARY GUID N_REALS [REFERENCE=VALUE ...]
 *
 * Inputs differ from instance to instance and from step to step; states are saved, serialized, restored into a second
 * instance, and go on there. Exit status 0 if all was right, 1 with the call that was not.
 */
#define _GNU_SOURCE

#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2.h"

enum { INSTANCES = 50, STEPS = 60, MAX_REALS = 512 };

typedef struct {
    int number;
    double reals[STEPS][MAX_REALS];
} Course;

static void *library;
static char **arguments;
static int n_inputs;
static size_t n_reals;

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                   fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)category;
    fprintf(stderr, "[%s] %d: %s\n", instance, (int)status, message);
}

static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};

static void check(int right, const char *what)
{
    if (!right) {
        fprintf(stderr, "wrong: %s\n", what);
        exit(1);
    }
}

static void *function(const char *name)
{
    void *symbol = dlsym(library, name);
    check(symbol != NULL, name);
    return symbol;
}

#define CALL(name, ...)                                                                                      \
    do {                                                                                                     \
        fmi2##name##Fn call;                                                                                 \
        void *symbol = function("fmi2" #name);                                                               \
        memcpy(&call, &symbol, sizeof symbol);                                                               \
        check(call(__VA_ARGS__) == fmi2OK, "fmi2" #name);                                                    \
    } while (0)

static void set_inputs(fmi2Component unit, int number, int k)
{
    for (int i = 0; i < n_inputs; i++) {
        fmi2ValueReference reference = (fmi2ValueReference)strtoul(arguments[i], NULL, 10);
        double value = strtod(strchr(arguments[i], '=') + 1, NULL) * (1.0 + 0.003 * number + 0.001 * k);
        CALL(SetReal, unit, &reference, 1, &value);
    }
}

static fmi2Component start(const char *guid, int number)
{
    fmi2InstantiateFn instantiate;
    void *symbol = function("fmi2Instantiate");
    memcpy(&instantiate, &symbol, sizeof symbol);
    fmi2Component unit = instantiate("unit", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    check(unit != NULL, "fmi2Instantiate");
    CALL(SetupExperiment, unit, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    set_inputs(unit, number, 0);
    CALL(EnterInitializationMode, unit);
    CALL(ExitInitializationMode, unit);
    return unit;
}

static void end(fmi2Component unit)
{
    fmi2FreeInstanceFn free_instance;
    void *symbol = function("fmi2FreeInstance");
    memcpy(&free_instance, &symbol, sizeof symbol);
    CALL(Terminate, unit);
    free_instance(unit);
}

static void *go(void *given)
{
    Course *course = given;
    fmi2ValueReference references[MAX_REALS];
    for (size_t i = 0; i < n_reals; i++) {
        references[i] = (fmi2ValueReference)i;
    }
    fmi2Component unit = start(arguments[-2], course->number);
    for (int k = 0; k < STEPS; k++) {
        if (k % 20 == 19) {
            fmi2FMUstate state = NULL, copy = NULL;
            size_t size = 0;
            CALL(GetFMUstate, unit, &state);
            CALL(SerializedFMUstateSize, unit, state, &size);
            char *bytes = malloc(size);
            check(bytes != NULL, "malloc");
            CALL(SerializeFMUstate, unit, state, bytes, size);
            CALL(FreeFMUstate, unit, &state);
            end(unit);
            unit = start(arguments[-2], 0);
            CALL(DeSerializeFMUstate, unit, bytes, size, &copy);
            CALL(SetFMUstate, unit, copy);
            CALL(FreeFMUstate, unit, &copy);
            free(bytes);
        }
        set_inputs(unit, course->number, k);
        CALL(DoStep, unit, 0.002 * k, 0.002, fmi2True);
        CALL(GetReal, unit, references, n_reals, course->reals[k]);
    }
    end(unit);
    return NULL;
}

int main(int argc, char *argv[])
{
    static Course together[INSTANCES], alone;
    pthread_t threads[INSTANCES];
    check(argc >= 4 && (library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL)) != NULL, "the library");
    arguments = argv + 4, n_inputs = argc - 4, n_reals = (size_t)atoi(argv[3]);
    check(n_reals <= MAX_REALS, "too many Reals");
    for (int i = 0; i < INSTANCES; i++) {
        together[i].number = i;
        check(pthread_create(&threads[i], NULL, go, &together[i]) == 0, "pthread_create");
    }
    for (int i = 0; i < INSTANCES; i++) {
        check(pthread_join(threads[i], NULL) == 0, "pthread_join");
    }
    for (int i = 0; i < INSTANCES; i++) {
        alone.number = i;
        go(&alone);
        check(memcmp(alone.reals, together[i].reals, sizeof alone.reals) == 0, "the same numbers");
    }
    return 0;
}
