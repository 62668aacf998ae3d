#include "claim.hpp"

#include "io/results.hpp"
#include "model/error.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <regex>

namespace subworld {

namespace {

// Domains that a run chooses by itself, the last first. Their ports start at 7400 + 250 times the domain and lie below
// 32768: above, Linux gives ports to any socket, which could occupy one of them.
constexpr int kFirstDomain = 60;
constexpr int kLastDomain = 100;

}  // namespace

int claim_domain(int wanted, FileLock& lock) {
  const auto claim = [&](int domain) { return lock.take(fmt::format("subworld-domain-{}", domain)); };
  if (wanted >= 0) {
    if (claim(wanted)) return wanted;
    throw Error(ExitCode::middleware,
                fmt::format("domain {} is in use by another run on this machine; choose another --domain, or omit it: "
                            "the first free one is taken",
                            wanted));
  }
  for (int domain = kLastDomain; domain >= kFirstDomain; --domain) {
    if (claim(domain)) return domain;
  }
  throw Error(ExitCode::middleware,
              fmt::format("all domains from {} to {} are in use by other runs; name one with --domain", kFirstDomain,
                          kLastDomain));
}

void claim_folder(std::string& folder, const std::string& scene, FileLock& lock) {
  if (folder.empty()) {
    const std::string wanted = fmt::format("out/{}-{:%Y%m%d-%H%M%S}", scene, fmt::localtime(std::time(nullptr)));
    make_folder("out");
    folder = wanted;
    for (int n = 2; !std::filesystem::create_directory(folder); ++n) folder = fmt::format("{}-{}", wanted, n);
  }
  make_folder(folder + "/logs");
  if (!lock.take_folder(folder)) {
    throw Error(ExitCode::usage, fmt::format("--out {}: another run writes its results there; choose another folder, "
                                             "or omit it: a new one is made",
                                             folder));
  }
  const std::regex ours(R"((summary|world|haptic_\d+|device_\d+)\.(json|csv)|bodies\.csv|picture\.png)");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    // Results go through a link that the user made.
    if (!entry.is_symlink() && std::regex_match(entry.path().filename().string(), ours))
      std::filesystem::remove(entry.path());
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder + "/logs")) {
    if (entry.path().extension() == ".log") std::filesystem::remove(entry.path());
  }
}

}  // namespace subworld
