/* A host on Windows: steps unit.dll ten times with its second input at 0.1 and prints its first output. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

#include "fmi2.h"

static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String c, fmi2String text, ...)
{
    (void)e, (void)c;
    fprintf(stderr, "%s: %d: %s\n", name, s, text);
}

#define FUNCTION(name) fmi2##name##Fn name = (fmi2##name##Fn)(void *)GetProcAddress(unit, "fmi2" #name)

int main(int count, char **arguments)
{
    HMODULE unit = LoadLibraryA("unit.dll");
    if (unit == NULL || count != 2) {
        return 2;
    }
    FUNCTION(SetupExperiment);
    FUNCTION(EnterInitializationMode);
    FUNCTION(ExitInitializationMode);
    FUNCTION(SetReal);
    FUNCTION(GetReal);
    FUNCTION(DoStep);
    fmi2InstantiateFn Instantiate = (fmi2InstantiateFn)(void *)GetProcAddress(unit, "fmi2Instantiate");
    fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
    fmi2Component c = Instantiate("unit", fmi2CoSimulation, arguments[1], "", &callbacks, 0, 0);
    if (c == NULL) {
        return 3;
    }
    fmi2ValueReference input = 0, output = 2;
    fmi2Real value = 0.1;
    int worst = SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) | EnterInitializationMode(c);
    worst |= SetReal(c, &input, 1, &value) | ExitInitializationMode(c);
    for (int i = 0; i < 10; i++) {
        worst |= DoStep(c, 0.001 * i, 0.001, 1) | GetReal(c, &output, 1, &value);
        printf("%a\n", value);
    }
    return worst;
}
