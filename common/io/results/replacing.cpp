#include "io/results/replacing.hpp"

#include "io/results/json.hpp"
#include "io/version.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <fstream>
#include <iterator>

namespace subworld {

namespace fs = std::filesystem;

namespace {

bool begins_with(const fs::path& file, std::string_view text) {
  std::string begin(text.size(), '\0');
  std::ifstream(file, std::ios::binary).read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin == text;
}

/// Whether there is something to lose.
bool has_content(const fs::path& file) {
  std::error_code none;
  return fs::is_regular_file(file, none) && fs::file_size(file, none) > 0;
}

}  // namespace

bool has_mark(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  return text.find(kOwnMark) != std::string::npos;
}

bool is_result(const fs::path& file) {
  const fs::path kind = file.extension();
  if (kind == ".part" || fs::file_size(file) == 0) return true;
  if (kind == ".csv") return begins_with(file, "time_s,");
  if (kind == ".checkpoint") return begins_with(file, "SUBWORLDCHECKPNT");
  if (kind != ".json")
    return has_mark(file) || (kind == ".png" && fs::exists(file.parent_path() / "logs/gui_headless.log"));
  try {
    const Json json = read_json(file);
    return json.is_object() && (json.contains("ending") || json.contains("verdict"));
  } catch (const Error&) {
    return false;
  }
}

void check_results(const std::string& folder, const std::vector<fs::path>& files) {
  for (const fs::path& file : files) {
    if (!has_content(file) || is_result(file)) continue;
    throw Error(ExitCode::usage, fmt::format("--out {}: holds {}, which Subworld has not made and would replace; move "
                                             "it, or choose another folder",
                                             folder, file.filename().string()));
  }
}

void check_replaced(const std::string& flag, const std::string& file, std::string_view begin) {
  if (!has_content(file) || begins_with(file, begin)) return;
  throw Error(ExitCode::usage, fmt::format("{} {}: the file holds something else, which the run would replace; "
                                           "choose another name, or remove it",
                                           flag, file));
}

}  // namespace subworld
