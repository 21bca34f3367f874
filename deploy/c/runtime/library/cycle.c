/* One call per tick for a bench: the frames that have come since the last cycle, each at its own time, then the cycle. */
#include "library.h"

#include <stddef.h>

uint8_t library_cycle(const LibraryFrame *received, uint32_t count, int64_t now_ns, EcuFrame *frames)
{
    uint8_t made = 0U;
    for (uint32_t k = 0U; k < count; ++k) {
        library_frame = k;
        ecu_receive(received[k].id, received[k].data, received[k].length, received[k].at_ns);
    }
    library_frame = count;
    if (frames != NULL) {
        made = ecu_tick(now_ns, frames);
    }
    return made;
}
