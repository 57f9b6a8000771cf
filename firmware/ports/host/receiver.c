/* The system buffers received bytes, and pvid_port_receive sleeps when there are none. */
#include "../receiver.h"

#include "../port.h"

void pvid_receiver_init(void)
{
}

size_t pvid_receiver_take(uint8_t bytes[], size_t room)
{
    return pvid_port_receive(bytes, room);
}

void pvid_receiver_rest(void)
{
}
