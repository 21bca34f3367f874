/*
 * Lists of measurements that the ECU sends by itself (DAQ), set up by the tool at run time.
 *
 * All lists are sampled at the end of a cycle from one image of it. After ecu/xcp/daq.py.
 */
#ifndef XCP_DAQ_H
#define XCP_DAQ_H

#include "xcp_packets.h"

void daq_reset(void); /* as after the start: no lists, and FREE_DAQ has to come before new ones */
bool daq_is_running(void);
void daq_sampled(uint32_t microseconds); /* sends the packets of this cycle */

XcpHandler daq_free;
XcpHandler daq_alloc;
XcpHandler daq_alloc_odt;
XcpHandler daq_alloc_odt_entry;
XcpHandler daq_clear;
XcpHandler daq_set_pointer;
XcpHandler daq_write;
XcpHandler daq_set_mode;
XcpHandler daq_get_mode;
XcpHandler daq_start_stop;
XcpHandler daq_start_stop_synch;
XcpHandler daq_get_processor_info;

#endif
