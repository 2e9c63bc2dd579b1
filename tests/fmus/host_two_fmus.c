/* Two FMUs in a host without Python: the one that has started Python is unloaded, the other goes on. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2.h"
static void logger(fmi2ComponentEnvironment e, fmi2String i, fmi2Status s, fmi2String c, fmi2String m, ...)
{
    (void)e;
    (void)i;
    (void)s;
    (void)c;
    fprintf(stderr, "%s\n", m);
}
static fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
static void *get(void *library, const char *name)
{
    return dlsym(library, name);
}
typedef struct {
    void *library;
    fmi2Component unit;
} Loaded;
/* Load the FMU of a binary, its resources and its GUID. */
static Loaded load(char *of[])
{
    Loaded l = {dlopen(of[0], RTLD_NOW | RTLD_LOCAL), NULL};
    fmi2InstantiateFn make;
    void *symbol = get(l.library, "fmi2Instantiate");
    memcpy(&make, &symbol, sizeof symbol);
    l.unit = make("unit", fmi2CoSimulation, of[2], of[1], &callbacks, fmi2False, fmi2False);
    return l;
}
static int call(Loaded l, const char *name)
{
    fmi2EnterInitializationModeFn f;
    void *symbol = get(l.library, name);
    memcpy(&f, &symbol, sizeof symbol);
    return f(l.unit);
}
static int step(Loaded l)
{
    fmi2DoStepFn f;
    void *symbol = get(l.library, "fmi2DoStep");
    memcpy(&f, &symbol, sizeof symbol);
    return f(l.unit, 0.0, 0.001, fmi2True);
}
static void unload(Loaded l)
{
    fmi2FreeInstanceFn f;
    void *symbol = get(l.library, "fmi2FreeInstance");
    memcpy(&f, &symbol, sizeof symbol);
    f(l.unit);
    dlclose(l.library);
}
int main(int argc, char *argv[])
{
    (void)argc;
    Loaded first = load(argv + 1), second = load(argv + 4);
    int status = call(first, "fmi2EnterInitializationMode") + call(first, "fmi2ExitInitializationMode");
    unload(first);
    status += call(second, "fmi2EnterInitializationMode") + call(second, "fmi2ExitInitializationMode");
    status += step(second);
    first = load(argv + 1);
    status += call(first, "fmi2EnterInitializationMode") + call(first, "fmi2ExitInitializationMode");
    unload(second);
    status += step(first);
    unload(first);
    return status;
}
