#pragma once

#include <sdf/sdf.hh>

#include <filesystem>

namespace subworld::import {

/// Both throw `Error` (usage) with the file, the line where it is known, and the reason.
[[noreturn]] void fail(const std::filesystem::path& file, const sdf::Errors& errors);
void load(sdf::Root& root, const std::filesystem::path& file, const sdf::ParserConfig& settings);

}  // namespace subworld::import
