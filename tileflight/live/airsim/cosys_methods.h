#pragma once

#include "tileflight/live/airsim/binder.h"
#include "tileflight/live/airsim/cosys_fields.h"

// The methods that clients of Cosys-AirSim (API version 4) call beyond AirSim's, and those whose arguments differ.
// (Camera calls without the last argument: MethodBinder::add_camera_method().)
namespace tileflight::airsim {

/// With the layer of an annotation image in place of the flag for external cameras.
template <class Caller>
void add_get_image(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  using Bytes = std::vector<std::uint8_t>;
  bind.table().template add<Bytes, std::string, int, std::string, ExternalFlag>(
      "simGetImage", [caller = bind.caller()](const std::string& camera, int image_type, const std::string& vehicle,
                                              const ExternalFlag& last) {
        return caller.template call<&S::sim_get_image, Bytes>(camera, image_type, vehicle, last.value,
                                                              last.annotation_name);
      });
}

template <class Caller>
void add_annotation_methods(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  bind.template add<&S::sim_list_annotation_objects>("simListAnnotationObjects");
  bind.template add<&S::sim_list_annotation_poses>("simListAnnotationPoses");
  bind.template add<&S::sim_set_annotation_object_id>("simSetAnnotationObjectID");
  bind.template add<&S::sim_get_annotation_object_id>("simGetAnnotationObjectID");
  bind.template add<&S::sim_set_annotation_object_color>("simSetAnnotationObjectColor");
  bind.template add<&S::sim_get_annotation_object_color>("simGetAnnotationObjectColor");
  bind.template add<&S::sim_set_annotation_object_value>("simSetAnnotationObjectValue");
  bind.template add<&S::sim_get_annotation_object_value>("simGetAnnotationObjectValue");
  bind.accept("simSetAnnotationObjectTextureByPath", false);
  bind.accept("simEnableAnnotationObjectTextureByPath", false);
  bind.table().template add<std::string, std::string, std::string>(
      "simGetAnnotationObjectTexturePath", [](const std::string&, const std::string&) { return std::string(); });
}

template <class Caller>
void add_cosys_methods(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  add_get_image(bind);
  add_annotation_methods(bind);
  bind.table().template add<simulator::Pose, std::string, bool>(
      "simGetObjectPose", [caller = bind.caller()](const std::string& name, bool /*ned*/) {
        return caller.template call<&S::sim_get_object_pose, simulator::Pose>(name);
      });
  bind.template add<&S::sim_list_scene_objects_tags>("simListSceneObjectsTags");
  bind.template add<&S::sim_list_instance_segmentation_objects>("simListInstanceSegmentationObjects");
  bind.template add<&S::sim_list_instance_segmentation_poses>("simListInstanceSegmentationPoses");
  bind.template add<&S::sim_get_instance_segmentation_color_map>("simGetInstanceSegmentationColorMap");
  bind.template add<&S::get_gpu_lidar_data>("getGPULidarData");
  bind.template add<&S::get_echo_data>("getEchoData");
  bind.template add<&S::get_computer_vision_state>("getComputerVisionState");
  bind.template add<&S::sim_get_ground_truth_kinematics>("simGetPhysicsRawKinematics");
  bind.accept("setEchoData");
  for (const char* name : {"simSetWorldLightVisibility", "simSetWorldLightIntensity", "simSetVehicleLightVisibility",
                           "simSetVehicleLightIntensity"})
    bind.accept(name, false);
  for (const char* name :
       {"simSetPhysicsRawKinematics", "getUWBData", "getUWBSensorData", "getWifiData", "getWifiSensorData"})
    bind.refuse(name);
}

}  // namespace tileflight::airsim
