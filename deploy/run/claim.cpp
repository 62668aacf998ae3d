#include "run/claim.hpp"

#include "io/results/output.hpp"
#include "io/results/replacing.hpp"
#include "model/error.hpp"
#include "watch/programs.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <fnmatch.h>
#include <netinet/in.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <vector>

namespace subworld {

namespace {

// Domains that a run chooses by itself, the last first. Their ports start at 7400 + 250 times the domain and lie below
// 32768: above, Linux gives ports to any socket, which could occupy one of them.
constexpr int kFirstDomain = 60;
constexpr int kLastDomain = 100;

}  // namespace

Claim::~Claim() {
  if (descriptor_ >= 0) close(descriptor_);
}

int Claim::take_file(const std::string& name) {
  const auto path = temporary_folder() + "/" + name + ".lock";
  // A lock needs no right to write. The file may be another user's, and the kernel then refuses to open it with
  // O_CREAT in a shared folder (fs.protected_regular).
  const int error = lock(path.c_str(), O_RDONLY);
  if (error != ENOENT) return error;
  const int created = lock(path.c_str(), O_RDONLY | O_CREAT);
  if (descriptor_ >= 0) fchmod(descriptor_, 0644);  // for the runs of other users, also under a umask of 077
  return created;
}

bool Claim::take_folder(const std::string& folder) {
  return lock(folder.c_str(), O_RDONLY | O_DIRECTORY) != EWOULDBLOCK;
}

int Claim::lock(const char* path, int flags) {
  if (descriptor_ >= 0) close(descriptor_);
  descriptor_ = open(path, flags | O_CLOEXEC, 0644);
  return descriptor_ >= 0 && flock(descriptor_, LOCK_EX | LOCK_NB) == 0 ? 0 : errno;
}

int Claim::take_port(int port) {
  if (descriptor_ >= 0) close(descriptor_);
  descriptor_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in all{};
  all.sin_family = AF_INET;
  all.sin_port = htons(static_cast<std::uint16_t>(port));
  const bool bound = descriptor_ >= 0 && bind(descriptor_, reinterpret_cast<const sockaddr*>(&all), sizeof all) == 0;
  return bound ? 0 : errno;
}

int claim_domain(int wanted, Claim& claim) {
  const auto take = [&](int domain) {
    const int error = claim.take_port(claim_port(domain));
    if (error == 0 || error == EADDRINUSE) return error == 0;
    throw Error(ExitCode::middleware, fmt::format("cannot claim domain {}: UDP port {}: {}; `subworld doctor` examines "
                                                  "the network",
                                                  domain, claim_port(domain), std::strerror(error)));
  };
  const std::vector<BoundPort> used = bound_udp_ports();
  if (wanted >= 0) {
    if (take(wanted)) return wanted;
    const auto holder = std::ranges::find(used, claim_port(wanted), &BoundPort::port);
    throw Error(ExitCode::middleware,
                fmt::format("domain {} is in use by {}; choose another --domain, or omit it: the first free one is "
                            "taken",
                            wanted, holder == used.end() ? "another run on this machine" : owner_text(*holder)));
  }
  for (int domain = kLastDomain; domain >= kFirstDomain; --domain) {
    if (!uses_domain(used, domain) && take(domain)) return domain;
  }
  throw Error(ExitCode::middleware,
              fmt::format("all domains from {} to {} are in use by other programs; name one with --domain",
                          kFirstDomain, kLastDomain));
}

void check_outputs(const Options& options) {
  check_replaced("--record", options.record, kRecordingBegin);
  check_replaced("--trace", options.trace, "[");
}

void claim_folder(std::string& folder, const std::string& scene, Claim& claim) {
  if (folder.empty()) {
    const std::string wanted = fmt::format("out/{}-{}", scene, local_time("%Y%m%d-%H%M%S"));
    make_folder("out");
    folder = wanted;
    for (int n = 2; !std::filesystem::create_directory(folder); ++n) folder = fmt::format("{}-{}", wanted, n);
  }
  make_folder(folder);
  if (!claim.take_folder(folder)) {
    throw Error(ExitCode::usage, fmt::format("--out {}: another run writes its results there; choose another folder, "
                                             "or omit it: a new one is made",
                                             folder));
  }
  constexpr const char* kOurs =
      "@(@(summary|world|haptic_+([0-9])|device_+([0-9])).@(json|csv)?(.part)|bodies.csv|last_+([a-z_]).csv|"
      "world_[01].checkpoint?(.part)|picture.png)";
  std::vector<std::filesystem::path> old;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    // Results go through a link that the user made.
    if (!entry.is_symlink() && fnmatch(kOurs, entry.path().filename().c_str(), FNM_EXTMATCH) == 0)
      old.push_back(entry.path());
  }
  check_results(folder, old);
  make_folder(folder + "/logs");
  for (const std::filesystem::path& file : old) std::filesystem::remove(file);
  const std::filesystem::path page = folder + "/report.html";
  if (std::filesystem::is_regular_file(std::filesystem::symlink_status(page)) && has_mark(page))
    std::filesystem::remove(page);
  for (const auto& entry : std::filesystem::directory_iterator(folder + "/logs")) {
    const std::string name = entry.path().filename();
    if (name.ends_with(".log") || (name.starts_with("last_") && name.ends_with(".csv")))
      std::filesystem::remove(entry.path());
  }
}

void check_resume(const Options& options) {
  if (options.resume.empty()) return;
  std::error_code none;
  const std::filesystem::path from = options.resume;
  if (!std::filesystem::exists(from, none))
    throw Error(ExitCode::usage, fmt::format("--resume {}: does not exist; name a folder of results, or a checkpoint "
                                             "in it",
                                             options.resume));
  const std::filesystem::path folder =
      std::filesystem::is_directory(from, none) ? from : from.parent_path() / std::filesystem::path(".");
  if (options.out.empty() || !std::filesystem::equivalent(folder, options.out, none)) return;
  throw Error(ExitCode::usage, fmt::format("--out {}: holds the run that --resume goes on from, and would be replaced; "
                                           "choose another folder",
                                           options.out));
}

}  // namespace subworld
