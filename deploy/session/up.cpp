#include "judge/ends.hpp"
#include "judge/report.hpp"
#include "link/network.hpp"
#include "model/error.hpp"
#include "plan/limits.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"
#include "run/claim.hpp"
#include "run/keeper.hpp"
#include "session/collect.hpp"
#include "session/distant_host.hpp"
#include "session/session.hpp"
#include "session/session_file.hpp"
#include "tools.hpp"
#include "watch/progress.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>

namespace subworld {

namespace {

/// The programs of a session from their start to their end.
class SessionRun {
 public:
  SessionRun(const SessionRequest& request, Session session, Scene scene, std::string out)
      : request_(request), session_(std::move(session)), out_(std::move(out)) {
    run_.scene = std::move(scene);
    for (const SessionHost& host : session_.hosts) {
      if (request.host.empty() || host.name == request.host) chosen_.push_back(&host);
    }
  }

  int operator()() {
    run_.command_line = request_.command_line;
    run_.date = date_of_now();
    run_.dds = session_.vendors();
    run_.session = session_.file;
    run_.between_hosts = session_.hosts.size() > 1;
    for (const SessionHost* const host : chosen_) {
      if (!is_distant(*host)) make_folder(folder_here(*host));
    }
    if (request_.namespaces) make_namespaces();
    // As the programs have it, from their --peers.
    run_.scene.settings.remote = run_.between_hosts && std::ranges::any_of(session_.hosts, [](const SessionHost& one) {
                                   return is_remote(one.address);
                                 });
    for (const SessionHost* const host : chosen_) check(*host);
    watch_stop_signals();
    const TimePoint begin = Clock::now();
    messages_.emplace(places_of_messages(run_.scene.settings.users));
    const Keeper keeper([&](const std::vector<Restarted>& restarts) {
      run_.restarts = restarts;
      run_.wall_s = to_seconds(Clock::now() - begin);
      fetch();
      if (!request_.host.empty()) return;  // its results are in their folder
      merge_results({out_ + "/hosts"}, out_);
      conclude_orphaned(run_, run_request(), out_, {});
      write_last_messages(run_, *messages_, out_);
    });
    Ended ended = watch(keeper);
    run_.wall_s = to_seconds(Clock::now() - begin);
    fetch();
    if (!request_.host.empty()) return report_share(ended);
    merge_results({out_ + "/hosts"}, out_);
    for (std::string& part : ended.parts) part = out_ + part.substr(part.rfind('/'));
    const int code = conclude_run(run_, ended, run_request(), out_, {});
    write_last_messages(run_, *messages_, out_);
    return code;
  }

 private:
  [[nodiscard]] RunRequest run_request() const {
    RunRequest request;
    request.options = session_.options;
    request.dds = session_.vendors();
    request.explain = request_.explain;
    request.strict = request_.strict;
    return request;
  }
  [[nodiscard]] bool is_distant(const SessionHost& host) const {
    return !request_.namespaces && request_.host.empty() && !host.ssh.empty();
  }
  [[nodiscard]] std::string folder_here(const SessionHost& host) const { return out_ + "/hosts/" + host.name; }
  [[nodiscard]] DistantHost distant(const SessionHost& host) const {
    return {host, request_.ssh, std::filesystem::absolute(out_).filename().string()};
  }

  /// Whether its programs can start there, and its clock.
  void check(const SessionHost& host) {
    run_.hosts.push_back({.host = host.name, .offset_s = 0.0, .uncertainty_s = 0.0});
    if (!is_distant(host)) return;
    distant(host).check(session_.file);
    run_.hosts.back() = distant(host).clock();
  }

  /// A network namespace for each host, with addresses and links between them.
  void make_namespaces() {
    network_.emplace(EmulatedNetworkSettings{.seed = request_.seed});
    for (const SessionHost& host : session_.hosts) network_->add_host(host.name);
    const LinkSettings link = parse_link(request_.link.empty() ? session_.link : request_.link);
    network_->set_links(link);
    run_.link = to_text(link);
    network_->start();
    for (std::size_t i = 0; i < session_.hosts.size(); ++i) {
      session_.hosts[i].address = network_->address(static_cast<int>(i));
      session_.hosts[i].network_interface = EmulatedNetwork::kInterface;
    }
    fmt::print("subworld: {} network namespaces; link between any two, each way: {}; {}\n", session_.hosts.size(),
               to_text(link), network_->description());
    fmt::print(
        "subworld: to control it, from another terminal: nsenter --net={} subworld control pause --domain {} "
        "--interface {}\n",
        network_->host(0).path(), session_.domain, EmulatedNetwork::kInterface);
    std::fflush(stdout);
  }
  /// The namespace of a host; null: this machine's own.
  [[nodiscard]] const NetworkHost* namespace_of(const SessionHost& host) const {
    return network_ ? &network_->host(static_cast<int>(&host - session_.hosts.data())) : nullptr;
  }

  /// Starts the programs, the world first: it ends the others in order.
  void start(Supervisor& programs) {
    int position = 0;
    const auto start_one = [&](const SessionProgram& program) {
      const std::string vendor = vendor_of(session_.dds, position++);
      for (const SessionHost* const host : chosen_) {
        if (std::ranges::find(host->programs, program) == host->programs.end()) continue;
        start(programs, *host, program, host->dds.empty() ? vendor : host->dds);
      }
    };
    start_one({"world_sim"});
    const int users = run_.scene.settings.users;
    const std::vector<int>& without = session_.options.without;
    for (int user = 0; user < users; ++user) {
      if (request_.host.empty() && std::ranges::find(without, user) != without.end()) {
        position += users > 1 ? 3 : 2;
        continue;  // the user's share starts later, with --host
      }
      start_one({"haptic_sim", user});
      start_one({"device_sim", user});
      if (users > 1) ++position;  // with mixed, users have different pairs of vendors
    }
    start_one({"gui_headless"});
  }

  void start(Supervisor& programs, const SessionHost& host, const SessionProgram& program, const std::string& vendor) {
    std::vector<std::string> words = settings_flags_of(session_.options);
    words.insert(words.end(), {"--domain", std::to_string(session_.domain), "--dds", vendor});
    if (!host.network_interface.empty()) words.insert(words.end(), {"--interface", host.network_interface});
    if (const auto peers = peers_of(host); !peers.empty())
      words.insert(words.end(), {"--peers", fmt::format("{}", fmt::join(peers, ","))});
    if (program.user >= 0) words.insert(words.end(), {"--user", std::to_string(program.user)});
    std::ranges::move(own_flags_of(session_.options, program.name, program.user), std::back_inserter(words));
    words.insert(words.end(), {"--out", is_distant(host) ? distant(host).folder() : folder_here(host)});
    const bool essential = program.name != "gui_headless";
    const std::string part = part_file(folder_here(host), program.name, program.user);
    Supervisor::Child child{.label = program.label(),
                            .log = fmt::format("{}/logs/{}.log", out_, program.label()),
                            .messages = messages_->place_of(place_of_messages(program.name, program.user)),
                            .part = essential ? part : "",
                            .essential = essential,
                            .host = host.name,
                            .may_restart = may_restart(run_.scene.settings, program.user),
                            .returns = program.user < 0 ? 0 : returns(run_.scene.settings.presence, program.user)};
    const bool world = program.name == "world_sim";
    if (!is_distant(host)) {
      if (world) child.arguments_again = [words, folder = folder_here(host)] { return resumed(words, folder); };
      const NetworkHost* const inside = namespace_of(host);
      programs.start(
          std::move(child), program_folder() + "/" + program.name, words,
          inside == nullptr ? std::function<bool()>() : [inside] { return inside->enter(); });
      return;
    }
    if (world) {
      child.arguments_again = [there = distant(host), words] {
        return there.words_of("world_sim", words, DistantHost::Resume::where_it_can);
      };
    }
    programs.start(std::move(child), request_.ssh, distant(host).words_of(program.name, words));
  }

  [[nodiscard]] std::vector<std::string> peers_of(const SessionHost& host) const {
    std::vector<std::string> peers;
    for (const SessionHost& other : session_.hosts) {
      if (other.name != host.name && !other.address.empty()) peers.push_back(other.address);
    }
    return peers;
  }

  Ended watch(const Keeper& keeper) {
    Supervisor programs(request_.restart, keeper);
    start(programs);
    std::optional<Supervisor::Failure> failure;
    Watchdog watchdog;
    {
      std::unique_ptr<Progress> progress = show(watchdog);
      failure = programs.watch(
          [&] {
            if (progress) (*progress)();
          },
          [&](const Supervisor::Child& child) { return early_end(child.part, run_.scene.settings.duration_s); });
    }
    Ended ended = end(programs, std::move(failure), watchdog);
    run_.restarts = programs.restarts();
    return ended;
  }

  /// Live progress needs a host of the session on this machine.
  std::unique_ptr<Progress> show(Watchdog& watchdog) {
    const auto here = std::ranges::find_if(chosen_, [&](const SessionHost* host) { return !is_distant(*host); });
    if (here == chosen_.end()) {
      fmt::print("subworld: no host of the session is on this machine: no live progress\n");
      return nullptr;
    }
    Network network = session_.options.network;
    network.dds = (*here)->dds.empty() ? vendor_of(session_.dds, 0) : (*here)->dds;
    network.domain = session_.domain;
    network.interface_address = (*here)->network_interface;
    network.peers = peers_of(**here);
    std::unique_ptr<Progress> progress;
    const auto open = [&] { progress = std::make_unique<Progress>(network, run_.scene, watchdog); };
    if (const NetworkHost* const inside = namespace_of(**here); inside != nullptr) {
      inside->inside(open);
    } else {
      open();
    }
    return progress;
  }

  /// Brings the results of distant hosts here.
  void fetch() {
    for (const SessionHost* const host : chosen_) {
      if (!is_distant(*host)) continue;
      make_folder(folder_here(*host));
      distant(*host).fetch(folder_here(*host));
    }
  }

  int report_share(const Ended& ended) {
    const std::string folder = folder_here(*chosen_.front());
    if (ended.failure) {
      const Supervisor::Child& failed = ended.failure->child;
      fmt::print(stderr, "subworld: error: {} {}; its log: {}\n", failed.name(), ended.failure->reason, failed.log);
      const int code = exit_code_of(failed);
      return code >= 1 && code <= 4 ? code : static_cast<int>(ExitCode::failed);
    }
    fmt::print(
        "results of host {}: {}\nthe verdict needs those of all hosts: copy them to one machine, then run\n"
        "  subworld collect DIR...\n",
        request_.host, folder);
    return static_cast<int>(ExitCode::done);
  }

  const SessionRequest& request_;
  Session session_;
  std::string out_;
  RunResults run_;
  std::vector<const SessionHost*> chosen_;
  std::optional<MessageMemory> messages_;
  std::optional<EmulatedNetwork> network_;  ///< with --namespaces
};

/// Throws `Error` (usage) where a host cannot find the others.
void check_hosts(const Session& session) {
  if (session.hosts.size() < 2) return;
  for (const SessionHost& host : session.hosts) {
    if (!host.address.empty() && !host.network_interface.empty()) continue;
    throw Error(ExitCode::usage,
                fmt::format("{}: host {} has no {}; add it, or run all hosts on this machine: --namespaces",
                            session.file, host.name, host.address.empty() ? "address" : "interface"));
  }
}

}  // namespace

int up(const SessionRequest& request) {
  end_at_stop_signals();
  raise_open_files();
  Session session = load_session(session_file(request.session));
  if (!request.dds.empty()) session.use_vendor(request.dds);
  Scene scene = load_scene(session.options);
  check_programs(session, scene);
  check_without(session.options, scene);
  RunRequest as_a_run;
  as_a_run.options = session.options;
  as_a_run.dds = session.vendors();
  as_a_run.restart = request.restart;
  check_request(scene, as_a_run);
  if (!request.host.empty()) (void)session.host(request.host);
  if (!request.host.empty() && request.namespaces) {
    throw Error(
        ExitCode::usage,
        "--host and --namespaces exclude each other: namespaces connect hosts of one command; run all hosts here "
        "with --namespaces alone, or one of several machines with --host alone");
  }
  if (!request.namespaces) check_hosts(session);
  std::string out = request.out;
  FileLock folder;
  claim_folder(out, session.name, folder);
  std::filesystem::remove_all(out + "/hosts");
  fmt::print("subworld: session {}: {} in {}, {} s, {} hosts, domain {}, results in {}\n", session.name, scene.file,
             scene.settings.mode == Mode::realtime ? "real time" : "lock-step", scene.settings.duration_s,
             session.hosts.size(), session.domain, out);
  return SessionRun(request, std::move(session), std::move(scene), std::move(out))();
}

}  // namespace subworld
