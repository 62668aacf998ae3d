#include "io/options.hpp"
#include "io/output.hpp"
#include "link/command.hpp"
#include "tools.hpp"

namespace {

int main_of(int argc, char** argv) {
  subworld::CommandLine line("subworld link", subworld::about_tool("link"));
  subworld::LinkRequest request;
  add_link_options(line, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  return run_link(request);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld link", subworld::guarded("subworld link", [&] { return main_of(argc, argv); }));
}
