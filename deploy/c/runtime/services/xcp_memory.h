/* What XCP addresses mean: texts, calibration pages and the measurements of the last cycle. After ecu/xcp/memory.py. */
#ifndef XCP_MEMORY_H
#define XCP_MEMORY_H

#include "xcp_packets.h"

void memory_start(void);
void memory_ended(void); /* a session is over: the calibration is the file's again */
void memory_text(const uint8_t *text, uint16_t length); /* what UPLOAD reads next, in the place of memory */
XcpResult memory_measured(uint32_t address, uint8_t extension, uint8_t size, uint16_t *offset); /* in the image of a cycle */

XcpHandler memory_set_mta;
XcpHandler memory_upload;
XcpHandler memory_short_upload;
XcpHandler memory_build_checksum;
XcpHandler memory_download;
XcpHandler memory_set_cal_page;
XcpHandler memory_get_cal_page;
XcpHandler memory_copy_cal_page;
XcpHandler memory_get_pag_processor_info;
XcpHandler memory_get_segment_info;
XcpHandler memory_get_page_info;

#endif
