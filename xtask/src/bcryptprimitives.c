/* Wine before 8.13 lacks bcryptprimitives.dll, from which Rust's standard library takes the random
   keys of its hash maps. This is that one function, for running under such a Wine only. */

#include <windows.h>
#include <ntsecapi.h>

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T length)
{
    return RtlGenRandom(data, (ULONG)length);
}
