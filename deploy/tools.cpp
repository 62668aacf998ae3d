#include "tools.hpp"

#include "model/error.hpp"
#include "model/places.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

namespace subworld {
namespace {

bool is_among(const auto& tools, std::string_view name) {
  return std::ranges::any_of(tools, [&](const Tool& tool) { return name == tool.name; });
}

}  // namespace

bool is_tool(std::string_view name) { return is_among(kTools, name); }
const char* about_tool(std::string_view name) {
  return std::ranges::find_if(kTools, [&](const Tool& tool) { return name == tool.name; })->about;
}
bool is_lab(std::string_view name) { return is_among(kLabs, name); }

std::string first_line_of(const std::string& command) {
  const std::unique_ptr<std::FILE, decltype([](std::FILE* pipe) { pclose(pipe); })> pipe(popen(command.c_str(), "re"));
  std::string line;
  for (int c = 0; pipe && (c = std::fgetc(pipe.get())) != EOF && c != '\n';) line += static_cast<char>(c);
  return line;
}

void become(const std::string& name, char** arguments) {
  const std::string program = (program_folder() / name).string();
  execv(program.c_str(), arguments);
  throw Error(ExitCode::failed,
              fmt::format("{}: cannot start ({}); build it with deploy/build, or install Subworld again", program,
                          std::strerror(errno)));
}

}  // namespace subworld
