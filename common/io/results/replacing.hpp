#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

/// A program replaces results of ours only.
namespace subworld {

/// Whether the file holds the mark of our pages, pictures and videos.
[[nodiscard]] bool has_mark(const std::filesystem::path& file);
/// Whether a run, a lab, a film, or a program that was started by hand, has made this file with a name of ours; or it
/// is empty.
[[nodiscard]] bool is_result(const std::filesystem::path& file);
/// Throws `Error` (usage) where one of these files in the folder of --out exists and is no result: it would be
/// replaced.
void check_results(const std::string& folder, const std::vector<std::filesystem::path>& files);
/// The same for the file of a flag. A file of ours begins with `begin`.
void check_replaced(const std::string& flag, const std::string& file, std::string_view begin);

/// With which the files of --record begin.
inline constexpr std::string_view kRecordingBegin = "\x89MCAP";

}  // namespace subworld
