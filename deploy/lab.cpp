#include "launch.hpp"
#include "model/error.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace subworld {

void become_lab(const std::string& name, char** arguments) {
  const std::string program = program_folder() + "/lab_" + name;
  execv(program.c_str(), arguments);
  throw Error(ExitCode::failed,
              fmt::format("{}: cannot start ({}); build it with deploy/build", program, std::strerror(errno)));
}

}  // namespace subworld
