#include "tileflight/live/airsim/levels.h"

#include <stdexcept>
#include <utility>

namespace tileflight::airsim {
namespace {

constexpr std::size_t kMaxNameLength = 100;

}  // namespace

Levels::Levels(std::shared_ptr<simulator::Simulator> first, std::map<std::string, std::string> sources, Open open,
               simulator::SimulatorLog log)
    : sources_(std::move(sources)), open_(std::move(open)), log_(std::move(log)), current_(std::move(first)) {}

std::shared_ptr<simulator::Simulator> Levels::current() const {
  const std::lock_guard lock(mutex_);
  return current_;
}

std::string Levels::known_names() const {
  if (sources_.empty()) return "the server was started without any (--level NAME=SOURCE)";
  std::string names;
  for (const auto& [name, source] : sources_) names += (names.empty() ? "the levels are: " : ", ") + name;
  return names;
}

bool Levels::load(const std::string& name) {
  const std::string call = "simLoadLevel('" + name.substr(0, kMaxNameLength) + "'): ";
  const auto source = sources_.find(name);
  if (source == sources_.end()) {
    if (log_) log_(call + known_names());
    return false;
  }
  const std::lock_guard loading(loading_mutex_);
  try {
    std::shared_ptr<simulator::Simulator> world = open_(source->second);
    {
      const std::lock_guard lock(mutex_);
      if (!stopped_) std::swap(world, current_);
    }
    world->stop();  // the old one; a new one that came too late
  } catch (const std::runtime_error& error) {
    if (log_) log_(call + error.what());
    return false;
  }
  const std::lock_guard lock(mutex_);
  return !stopped_;
}

void Levels::stop() {
  std::shared_ptr<simulator::Simulator> last;
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    last = current_;
  }
  last->stop();
}

}  // namespace tileflight::airsim
