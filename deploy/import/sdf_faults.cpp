#include "import/sdf_faults.hpp"

#include "model/error.hpp"

#include <fmt/core.h>
#include <tinyxml2.h>

#include <algorithm>
#include <cctype>
#include <iostream>
#include <sstream>
#include <string>
#include <string_view>

namespace subworld::import {

namespace {

void check_xml(const std::filesystem::path& file) {
  tinyxml2::XMLDocument document;
  if (document.LoadFile(file.c_str()) == tinyxml2::XML_SUCCESS) return;
  std::string why = document.ErrorName();  // XML_ERROR_MISMATCHED_ELEMENT
  for (char& c : why) c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const int line = document.ErrorLineNum();
  throw Error(ExitCode::usage,
              fmt::format("{}{}: cannot be parsed: {}; is the file complete? Mend it, or export it again",
                          file.string(), line > 0 ? fmt::format(":{}", line) : "", why));
}

/// The parser of URDF writes its reasons to std::cerr, as "Error:   REASON" and where in its code.
void throw_reasons(const std::filesystem::path& file, const std::string& written) {
  constexpr std::string_view kBegin = "Error:";
  std::istringstream lines(written);
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(kBegin)) continue;
    const std::size_t reason = std::min(line.find_first_not_of(' ', kBegin.size()), line.size());
    text += fmt::format("{}{}: {}", text.empty() ? "" : "\n", file.string(), line.substr(reason));
  }
  if (!text.empty()) throw Error(ExitCode::usage, text);
}

}  // namespace

void fail(const std::filesystem::path& file, const sdf::Errors& errors) {
  std::string text;
  for (const sdf::Error& error : errors) {
    const std::string line = error.LineNumber() ? fmt::format(":{}", *error.LineNumber()) : "";
    text += fmt::format("{}{}{}: {}", text.empty() ? "" : "\n", file.string(), line, error.Message());
  }
  throw Error(ExitCode::usage, text);
}

void load(sdf::Root& root, const std::filesystem::path& file, const sdf::ParserConfig& settings) {
  check_xml(file);
  std::ostringstream written;
  std::streambuf* const to = std::cerr.rdbuf(written.rdbuf());
  const sdf::Errors errors = root.Load(file.string(), settings);
  std::cerr.rdbuf(to);
  if (!errors.empty()) {
    if (errors.front().Code() == sdf::ErrorCode::FILE_READ) throw_reasons(file, written.str());
    fail(file, errors);
  }
  std::cerr << written.str();
}

}  // namespace subworld::import
