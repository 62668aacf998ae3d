#include "session/host.hpp"

#include "link/settings.hpp"
#include "model/places.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <filesystem>

namespace subworld {

Command Host::command(const RunProgram& program, std::vector<std::string> flags, bool again) const {
  const auto has = [&](const char* checkpoint) { return std::filesystem::exists(folder_here_ + "/" + checkpoint); };
  if (again && program.name == "world_sim" && (has("world_0.checkpoint") || has("world_1.checkpoint")))
    flags.insert(flags.end(), {"--resume", folder_here_});  // of several the last counts
  Command command{(program_folder() / program.name).string(), std::move(flags)};
  if (inside_ != nullptr) command.enter = [inside = inside_] { return inside->enter(); };
  return command;
}

std::unique_ptr<EmulatedNetwork> make_namespaces(Session& session, const RunRequest& request, std::string& link) {
  auto network = std::make_unique<EmulatedNetwork>(request.seed);
  for (const SessionHost& host : session.hosts) network->add_host(host.name);
  const LinkSettings wanted = parse_link(request.link.empty() ? session.link : request.link);
  network->set_links(wanted);
  network->start();
  for (std::size_t i = 0; i < session.hosts.size(); ++i) {
    session.hosts[i].address = network->address(static_cast<int>(i));
    session.hosts[i].network_interface = EmulatedNetwork::kInterface;
  }
  link = to_text(wanted);
  fmt::print("subworld: {} network namespaces; link between any two, each way: {}; forwarded with {}\n",
             session.hosts.size(), link, network->scheduling());
  fmt::print(
      "subworld: to control it, from another terminal: nsenter --net={} subworld control pause --domain {} "
      "--interface {}\n",
      network->host(0).path(), session.domain, EmulatedNetwork::kInterface);
  std::fflush(stdout);
  return network;
}

}  // namespace subworld
