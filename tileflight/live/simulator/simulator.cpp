#include "tileflight/live/simulator/simulator.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/simulator_impl.h"

namespace tileflight::simulator {

Simulator::Simulator(const SimulatorOptions& options, SimulatorLog log, const Progress& progress)
    : impl_(std::make_unique<Impl>(options, std::nullopt, std::move(log), progress)) {}

Simulator::Simulator(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log)
    : impl_(std::make_unique<Impl>(options, std::move(meshes), std::move(log), Progress{})) {}

Simulator::~Simulator() { stop(); }

void Simulator::stop() {
  {
    const std::lock_guard lock(impl_->state_mutex);
    for (const auto& one : impl_->vehicles) one->vehicle->cancel();
  }
  impl_->clock.stop();
  for (const auto& port : impl_->ardupilot_ports) port->stop();
  for (const auto& port : impl_->px4_ports) port->stop();
}

std::optional<int> Simulator::settings_port() const { return impl_->settings.port; }
std::optional<std::string> Simulator::settings_address() const { return impl_->settings.address; }
std::vector<std::string> Simulator::warnings() const { return impl_->warnings; }

std::vector<AutopilotEndpoint> Simulator::autopilots() const {
  const std::lock_guard lock(impl_->state_mutex);
  std::vector<AutopilotEndpoint> endpoints;
  const auto add = [&](const auto& ports, const char* protocol) {
    for (const auto& port : ports) {
      const LockstepVehicle& vehicle = port->vehicle();
      endpoints.push_back({vehicle.name(), protocol, impl_->options.autopilot_address, port->port(), vehicle.home(),
                           vehicle.home_heading_deg()});
    }
  };
  add(impl_->ardupilot_ports, "ArduPilot JSON, UDP");
  add(impl_->px4_ports, "PX4 HIL, TCP");
  return endpoints;
}

bool Simulator::ping() const { return true; }
int Simulator::get_server_version() const { return 1; }
int Simulator::get_min_required_client_version() const { return 1; }
std::string Simulator::get_settings_string() const {
  return is_blank(impl_->options.settings) ? default_settings_text() : impl_->options.settings;
}

std::vector<std::string> Simulator::list_vehicles() const {
  const std::lock_guard lock(impl_->state_mutex);
  std::vector<std::string> names;
  for (const auto& one : impl_->vehicles) names.push_back(one->vehicle->name());
  return names;
}

void Simulator::reset() {
  const std::lock_guard lock(impl_->state_mutex);
  for (const auto& one : impl_->vehicles) {
    one->vehicle->reset();
    one->history.clear();
    one->sensor_noises.clear();
    one->view_noises.clear();
  }
  impl_->external_cameras.clear();
  for (const CameraSettings& camera : impl_->settings.external_cameras) impl_->external_cameras.emplace_back(camera);
  impl_->last_pictures.clear();
  impl_->clock.wake();
}

void Simulator::sim_pause(bool is_paused) {
  const std::lock_guard lock(impl_->state_mutex);
  impl_->clock.set_paused(is_paused);
}

bool Simulator::sim_is_paused() const {
  const std::lock_guard lock(impl_->state_mutex);
  return impl_->clock.paused();
}

void Simulator::sim_continue_for_time(double seconds) {
  constexpr double kMost_s = 3600.0;
  if (!(seconds >= 0.0 && seconds <= kMost_s))
    throw InputError("simContinueForTime", "the time must be from 0 to 3600 seconds");
  sim_continue_for_frames(static_cast<std::uint32_t>(std::ceil(seconds / SimulationClock::kStep_s - 1e-6)));
}

void Simulator::sim_continue_for_frames(std::uint32_t frames) {
  constexpr std::uint32_t kMost = 1'200'000;
  if (frames > kMost) throw InputError("simContinueForFrames", "more than 1200000 steps");
  std::unique_lock lock(impl_->state_mutex);
  impl_->clock.run_steps(lock, frames);
}

}  // namespace tileflight::simulator
