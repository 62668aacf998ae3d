#pragma once

#include <string>

namespace subworld {

/// From here on a write to stdout or stderr that fails throws nothing and ends nothing: a full disk loses messages, but
/// no run. Call it before anything is printed; again: does nothing.
void outlive_full_output();
/// Why something that was printed to stdout is lost, and the cure; empty: nothing is, or the reader has left.
[[nodiscard]] std::string lost_output();
/// The exit code of a program that has ended with `code`: failed, with a message, where something printed is lost.
[[nodiscard]] int finished(const char* program, int code);
/// The folder of temporary files: that of TMPDIR where it can be written, else /tmp.
[[nodiscard]] std::string temporary_folder();
/// A word for a shell, in quotes.
[[nodiscard]] std::string shell_word(const std::string& word);
/// The time of day in this machine's zone, in the form of strftime().
[[nodiscard]] std::string local_time(const char* form);

}  // namespace subworld
