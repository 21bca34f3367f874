/* Lines on standard error, in the form of `loaderhil ecu`: time, source, level, message. */
#ifndef LOG_H
#define LOG_H

/* Trouble on the bus. The same within a second is counted, and the next line says the count. */
void log_bus(const char *words, const char *detail);
void log_note(const char *words, const char *detail);

#endif
