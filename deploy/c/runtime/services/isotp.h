/*
 * ISO-TP (ISO 15765-2) on one pair of identifiers of classic CAN: frames in, requests out; answers in, frames out.
 *
 * Half duplex: what comes while an answer is under way is for the caller to leave out. Sent frames go to service_answered.
 */
#ifndef ISOTP_H
#define ISOTP_H

#include <stdbool.h>
#include <stdint.h>

#define ISOTP_LONGEST_REQUEST 255U /* a first frame that announces more is answered by an overflow */
#define ISOTP_LONGEST_ANSWER 4095U

typedef struct {
    uint8_t bytes[ISOTP_LONGEST_REQUEST];
    uint16_t length;
} Request;

void isotp_start(uint32_t send);

/* Take one frame of the tool; true where a request is complete, which is then in *request. */
bool isotp_receive(const uint8_t *data, uint8_t length, int64_t now_ns, Request *request);

/* Begin to send an answer; its bytes have to stay until isotp_is_sending is false. */
void isotp_answered(const uint8_t *bytes, uint16_t length, int64_t now_ns);

void isotp_cycle(int64_t now_ns); /* timeouts, and the frames for which the tool wanted a pause */
bool isotp_is_sending(void);

#endif
