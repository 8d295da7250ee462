#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "tileflight/live/simulator/simulator.h"

namespace tileflight::airsim {

/// The worlds that simLoadLevel chooses from, of which one is served at a time. Thread-safe.
class Levels {
 public:
  /// Opens the world of a source. Throws InputError or std::runtime_error.
  using Open = std::function<std::unique_ptr<simulator::Simulator>(const std::string& source)>;

  /// `sources`: the source of each level, by name. `open` and `log` may be called from any thread.
  explicit Levels(std::shared_ptr<simulator::Simulator> first, std::map<std::string, std::string> sources = {},
                  Open open = {}, simulator::SimulatorLog log = {});

  /// Returns the world that is served; running calls keep theirs alive.
  std::shared_ptr<simulator::Simulator> current() const;
  /// Replaces the world by that of a level and cancels the old world's tasks. Blocks until the new world is open.
  /// Returns false and keeps the old world if the level is unknown or cannot be opened, or stop() was called; the log
  /// says why.
  bool load(const std::string& name);
  /// Stops the world that is served (Simulator::stop()) and any that is still being loaded.
  void stop();

 private:
  std::string known_names() const;

  std::map<std::string, std::string> sources_;
  Open open_;
  simulator::SimulatorLog log_;
  std::mutex loading_mutex_;  ///< one level at a time; locked before `mutex_`
  mutable std::mutex mutex_;  ///< guards what follows
  std::shared_ptr<simulator::Simulator> current_;
  bool stopped_ = false;
};

}  // namespace tileflight::airsim
