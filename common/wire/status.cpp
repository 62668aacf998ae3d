#include "wire/status.hpp"

#include "wire/session.hpp"

#include <sched.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr const char* kRunning = "running";
constexpr std::chrono::milliseconds kTick{250};
constexpr int kTicksPerStatus = 4;
constexpr std::size_t kMostHeard = 4096;  // participants and what they are

void append(std::string& text, const std::string& more) {
  if (!text.empty() && !more.empty()) text += "; ";
  text += more;
}

}  // namespace

StatusBeacon::StatusBeacon(Bus& bus, ProgramKind program, std::uint32_t instance, std::string label)
    : bus_(&bus),
      writer_(bus.writer<Status>()),
      replies_(bus.writer<ControlReply>()),
      reader_(bus.reader<Status>()),
      label_(std::move(label)) {
  status_.program = program;
  status_.instance = instance;
  thread_ = std::thread([this] {
    const sched_param whenever{};
    sched_setscheduler(0, SCHED_OTHER, &whenever);
    int ticks = 0;
    for (bool stopping = false; !stopping;) {
      const bool woken = wake_.try_acquire_for(kTick);
      while (wake_.try_acquire()) {
      }
      stopping = stop_;  // read first, so that the last notes before the end are still published below
      if (!woken) listen();
      const bool due = !woken && ++ticks % kTicksPerStatus == 0;
      const std::lock_guard lock(mutex_);
      if ((due && !stopping) || newest_note_.load(std::memory_order_relaxed) != nullptr) publish(due);
    }
  });
}

void StatusBeacon::listen() {
  for (auto& ticks : status_age_ticks_) ticks.fetch_add(1, std::memory_order_relaxed);
  for (Take taken = reader_.take(heard_); taken != Take::none; taken = reader_.take(heard_)) {
    const auto program = static_cast<std::size_t>(heard_.program);
    if (taken != Take::sample || program >= kPrograms || heard_.instance >= kInstances) continue;
    const std::size_t slot = program * kInstances + heard_.instance;
    hear_participant(reader_.sender_participant(), heard_);
    if (heard_.wire_version != kWireVersion) {
      if (!std::exchange(other_version_, true)) {
        note("a program on this domain has version " + std::to_string(heard_.wire_version) +
             " of the messages, this one " + std::to_string(kWireVersion) +
             "; install the same version of Subworld on all hosts");
      }
      continue;
    }
    hear_end(heard_, slot, reader_.sender_participant());
    status_age_ticks_[slot].store(0, std::memory_order_relaxed);
    met_[slot].store(true, std::memory_order_relaxed);
  }
}

void StatusBeacon::hear_participant(std::uint64_t participant, const Status& status) {
  const std::lock_guard lock(words_mutex_);
  if (programs_of_.size() >= kMostHeard) return;
  const bool readable = status.wire_version == kWireVersion;
  programs_of_.emplace(participant, readable ? static_cast<std::size_t>(status.program) : kPrograms);
}

bool StatusBeacon::is_program(ProgramKind program, std::uint64_t participant) const {
  const std::lock_guard lock(words_mutex_);
  return programs_of_.contains({participant, static_cast<std::size_t>(program)}) ||
         programs_of_.contains({participant, kPrograms});
}

void StatusBeacon::hear_end(const Status& status, std::size_t slot, std::uint64_t participant) {
  const bool failed = status.state == kFailedState;
  std::string who = label_of(status.program, status.instance);
  {
    const std::lock_guard lock(words_mutex_);
    Heard& heard = heard_of_[slot];
    if (status.state == kRunning) heard = {.ran = true, .process = heard.process, .last_words = {}};
    // A program that has run does not begin anew: this is another one, whose end is not that of the first.
    heard.another =
        heard.another || (heard.ran && !failed && status.state != kRunning && status.state != kStoppingState);
    heard.newest = participant;
    if (!failed && !heard.another) heard.last_words.clear();  // started anew before the run
    if (!heard.another) heard.stopped = status.state == kStoppingState;
    if (!failed) return;
    if (heard.another) {
      who = "another " + who;
    } else if (!std::exchange(heard.last_words, status.text).empty()) {
      return;
    }
  }
  if (label_ != who) note(who + " has ended: " + status.text);
}

void StatusBeacon::fail(const std::string& reason) {
  constexpr double kAcknowledged_s = 0.5;
  std::fprintf(stderr, "%s: error: %s\n", label_.substr(0, label_.find(' ')).c_str(), reason.c_str());
  {
    const std::lock_guard lock(mutex_);
    status_.state = kFailedState;
    status_.text = reason;
    if (!writer_.write(status_)) return;
    failed_ = true;
  }
  writer_.wait_for_acknowledgments(kAcknowledged_s);
}

std::string StatusBeacon::last_words(ProgramKind program, std::uint32_t instance) const {
  const std::lock_guard lock(words_mutex_);
  const auto heard = heard_of_.find(static_cast<std::size_t>(program) * kInstances + instance);
  return heard == heard_of_.end() ? "" : heard->second.last_words;
}

bool StatusBeacon::has_ended(ProgramKind program, std::uint32_t instance) const {
  const std::lock_guard lock(words_mutex_);
  const auto heard = heard_of_.find(static_cast<std::size_t>(program) * kInstances + instance);
  return heard != heard_of_.end() && (heard->second.stopped || !heard->second.last_words.empty());
}

void StatusBeacon::begins(ProgramKind program, std::uint32_t instance, std::uint64_t participant) {
  const std::lock_guard lock(words_mutex_);
  // It runs, although its next status may be a second away: where it dies before, its successor is another process.
  heard_of_[static_cast<std::size_t>(program) * kInstances + instance] = {
      .ran = true, .process = participant, .newest = participant, .last_words = {}};
}

bool StatusBeacon::is_replaced(ProgramKind program, std::uint32_t instance) const {
  const std::lock_guard lock(words_mutex_);
  const auto heard = heard_of_.find(static_cast<std::size_t>(program) * kInstances + instance);
  if (heard == heard_of_.end()) return false;
  // It may run before those have noticed that its predecessor has died.
  const auto& [ran, another, stopped, process, newest, last_words] = heard->second;
  return process != 0 && newest != 0 ? newest != process : another;
}

bool StatusBeacon::runs(ProgramKind program, std::uint32_t instance) const {
  const std::lock_guard lock(words_mutex_);
  const auto heard = heard_of_.find(static_cast<std::size_t>(program) * kInstances + instance);
  return heard != heard_of_.end() && heard->second.ran && !heard->second.stopped && heard->second.last_words.empty();
}

std::string StatusBeacon::gone_text(ProgramKind program, std::uint32_t instance) const {
  const std::string label = label_of(program, instance);
  const std::string why = last_words(program, instance);
  if (!why.empty()) return label + " has ended: " + why;
  if (has_ended(program, instance)) return label + " was stopped before the end of the run";
  return label + " has died, is suspended, or cannot be reached over the network: it sends no sign of life";
}

bool StatusBeacon::met(ProgramKind program, std::uint32_t instance) const noexcept {
  const std::size_t slot = static_cast<std::size_t>(program) * kInstances + instance;
  return slot < met_.size() && met_[slot].load(std::memory_order_relaxed);
}

double StatusBeacon::status_age_s(ProgramKind program, std::uint32_t instance) const noexcept {
  const std::size_t slot = static_cast<std::size_t>(program) * kInstances + instance;
  if (slot >= status_age_ticks_.size()) return 0.0;
  return std::chrono::duration<double>(kTick).count() * status_age_ticks_[slot].load(std::memory_order_relaxed);
}

StatusBeacon::~StatusBeacon() {
  stop_ = true;
  wake_.release();
  thread_.join();
}

void StatusBeacon::update(const LoopState& loop) noexcept {
  time_s_.store(loop.time_s, std::memory_order_relaxed);
  steps_.store(loop.steps, std::memory_order_relaxed);
  missed_.store(loop.missed, std::memory_order_relaxed);
  missed_by_os_.store(loop.missed_by_os, std::memory_order_relaxed);
  busy_s_.store(loop.busy_s, std::memory_order_relaxed);
  force_n_.store(loop.force_n, std::memory_order_relaxed);
  real_time_factor_.store(loop.real_time_factor, std::memory_order_relaxed);
}

void StatusBeacon::enter(const std::string& state) {
  const std::lock_guard lock(mutex_);
  status_.state = state;
  done(0.0);
  absences_.clear();
  bus_->forget_absences();
  if (state == kRunning) at_start_ = bus_->events();
  publish(false);
}

EventCounts StatusBeacon::events_of_run() {
  const std::lock_guard lock(mutex_);
  return bus_->events() - at_start_;
}

std::string StatusBeacon::take_events() {
  std::string text = bus_->take_event_text(EventKind::fault);
  if (counted_steps_ == 0) bus_->forget_absences();  // no step was made before the last status
  if (status_.state != kRunning) return text;
  append(text, std::exchange(absences_, bus_->take_event_text(EventKind::absence)));
  return text;
}

void StatusBeacon::note(std::string text, std::optional<std::string> waits_for) {
  leave(new Note{std::move(text), std::move(waits_for), {}, newest_note_.load(std::memory_order_relaxed)});
}

void StatusBeacon::answer(std::uint32_t order, OrderAnswer answer) {
  ControlReply reply{status_.program, status_.instance, order, std::move(answer)};
  leave(new Note{{}, {}, std::move(reply), newest_note_.load(std::memory_order_relaxed)});
}

void StatusBeacon::leave(Note* note) {
  while (!newest_note_.compare_exchange_weak(note->earlier, note, std::memory_order_release)) {
  }
  wake_.release();
}

std::string StatusBeacon::take_notes() {
  std::string text;
  std::optional<std::string> waits_for;
  std::vector<ControlReply> replies;  // the newest first
  std::unique_ptr<Note> note(newest_note_.exchange(nullptr, std::memory_order_acquire));
  while (note != nullptr) {
    if (!waits_for) waits_for = std::move(note->waits_for);
    if (note->reply) replies.push_back(*std::move(note->reply));
    append(note->text, text);
    text = std::move(note->text);
    note.reset(note->earlier);
  }
  for (auto reply = replies.rbegin(); reply != replies.rend(); ++reply) {
    replies_.write(*reply);
    std::fprintf(stderr, "%s: order %u %s: %s\n", label_.c_str(), reply->number,
                 reply->answer.outcome == OrderState::refused ? "refused" : "followed", reply->answer.text.c_str());
  }
  if (waits_for) status_.waits_for = *std::move(waits_for);
  return text;
}

void StatusBeacon::publish(bool due) {
  if (failed_) return;  // the reason stays its last word
  const std::uint64_t steps = steps_.load(std::memory_order_relaxed);
  std::string text = due ? take_events() : bus_->take_event_text(EventKind::fault);
  const double busy_s = busy_s_.load(std::memory_order_relaxed);
  if (due) {
    // On a busy machine this thread wakes late.
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double> passed = now - counted_at_;
    const auto made = static_cast<double>(steps - counted_steps_);
    status_.rate_hz = made / passed.count();
    status_.step_s = (busy_s - counted_busy_s_) / std::max(1.0, made);
    counted_at_ = now;
    counted_steps_ = steps;
    counted_busy_s_ = busy_s;
  }
  status_.time_s = time_s_.load(std::memory_order_relaxed);
  status_.steps = steps;
  status_.missed_deadlines = missed_.load(std::memory_order_relaxed);
  status_.missed_by_os = missed_by_os_.load(std::memory_order_relaxed);
  status_.force_n = force_n_.load(std::memory_order_relaxed);
  status_.real_time_factor = real_time_factor_.load(std::memory_order_relaxed);
  status_.done_ratio = done_ratio_.load(std::memory_order_relaxed);
  status_.events = bus_->events();
  append(text, take_notes());
  status_.paused = paused_.load(std::memory_order_relaxed);  // as set before the notes
  if (!text.empty()) std::fprintf(stderr, "%s: %s\n", label_.c_str(), text.c_str());
  append(unsent_, text);
  status_.text = unsent_;
  if (writer_.write(status_)) unsent_.clear();
}

}  // namespace subworld
