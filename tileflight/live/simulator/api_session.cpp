#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/simulator_impl.h"

// What recorded sessions need of the simulator.
namespace tileflight::simulator {

Simulator::Turn::Turn(Simulator& simulator) : simulator_(simulator) {
  std::unique_lock lock(simulator_.impl_->state_mutex);
  simulator_.impl_->clock.take_turn(lock);
  tick_ = simulator_.impl_->clock.steps();
}

Simulator::Turn::~Turn() {
  const std::lock_guard lock(simulator_.impl_->state_mutex);
  simulator_.impl_->clock.end_turn();
}

std::int64_t Simulator::tick() const {
  const std::lock_guard lock(impl_->state_mutex);
  return impl_->clock.steps();
}

std::uint64_t Simulator::clock_start_ns() const { return impl_->clock.start_ns(); }

void Simulator::advance_to(std::int64_t tick) {
  std::unique_lock lock(impl_->state_mutex);
  impl_->clock.drive_to(lock, tick);
}

std::string Simulator::apply(const AutopilotEvent& event) {
  const auto vehicle = impl_->repeated_vehicles.find(event.vehicle);
  if (vehicle == impl_->repeated_vehicles.end())
    throw InputError("vehicle '" + event.vehicle.substr(0, 100) + "'", "has no autopilot whose flight can be repeated");
  return vehicle->second.apply(event);
}

}  // namespace tileflight::simulator
