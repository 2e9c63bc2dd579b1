/* A host on Windows. Each line of its input names a unit:
 *
 *     LIBRARY GUID N_REALS [REFERENCE=VALUE ...]
 *
 * It takes ten steps of 1 ms, saved and restored half way, and prints all Reals after each in one line. Exit status 0
 * if every call answered OK. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <windows.h>

#include "fmi2.h"

#define MAX_REALS 512

static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String c, fmi2String text, ...)
{
    (void)e, (void)c;
    fprintf(stderr, "%s: %d: %s\n", name, s, text);
}

#define FUNCTION(name) fmi2##name##Fn name = (fmi2##name##Fn)(void *)GetProcAddress(library, "fmi2" #name)

/* Run a unit whose inputs strtok() gives next. */
static int run(const char *file, const char *guid, size_t n)
{
    HMODULE library = LoadLibraryA(file);
    if (library == NULL || n > MAX_REALS) {
        return 2;
    }
    FUNCTION(SetupExperiment);
    FUNCTION(EnterInitializationMode);
    FUNCTION(ExitInitializationMode);
    FUNCTION(SetReal);
    FUNCTION(GetReal);
    FUNCTION(DoStep);
    FUNCTION(GetFMUstate);
    FUNCTION(SetFMUstate);
    FUNCTION(FreeFMUstate);
    FUNCTION(Terminate);
    fmi2InstantiateFn Instantiate = (fmi2InstantiateFn)(void *)GetProcAddress(library, "fmi2Instantiate");
    fmi2FreeInstanceFn Free = (fmi2FreeInstanceFn)(void *)GetProcAddress(library, "fmi2FreeInstance");
    fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
    fmi2Component c = Instantiate(file, fmi2CoSimulation, guid, "", &callbacks, 0, 0);
    if (c == NULL) {
        return 3;
    }
    fmi2ValueReference all[MAX_REALS];
    fmi2Real values[MAX_REALS];
    for (size_t i = 0; i < n; i++) {
        all[i] = (fmi2ValueReference)i;
    }
    int worst = SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0);
    for (char *one = strtok(NULL, " \n"); one != NULL; one = strtok(NULL, " \n")) {
        fmi2ValueReference reference = (fmi2ValueReference)atoi(one);
        fmi2Real value = strtod(strchr(one, '=') + 1, NULL);
        worst |= SetReal(c, &reference, 1, &value);
    }
    worst |= EnterInitializationMode(c) | ExitInitializationMode(c);
    fmi2FMUstate state = NULL;
    for (int i = 0; i < 10; i++) {
        if (i == 5) {
            worst |= GetFMUstate(c, &state) | DoStep(c, 0.001 * i, 0.1, 1) | SetFMUstate(c, state);
            worst |= FreeFMUstate(c, &state);
        }
        worst |= DoStep(c, 0.001 * i, 0.001, 1) | GetReal(c, all, n, values);
        for (size_t k = 0; k < n; k++) {
            printf("%a%c", values[k], k + 1 < n ? ' ' : '\n');
        }
    }
    worst |= Terminate(c);
    Free(c);
    FreeLibrary(library);
    return worst;
}

int main(void)
{
    static char line[1 << 16];
    int worst = 0;
    while (worst == 0 && fgets(line, sizeof line, stdin) != NULL) {
        char *file = strtok(line, " "), *guid = strtok(NULL, " "), *reals = strtok(NULL, " \n");
        worst = run(file, guid, (size_t)atoi(reals));
    }
    return worst;
}
