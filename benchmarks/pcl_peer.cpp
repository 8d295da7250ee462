// Point-to-point registration by the Point Cloud Library, for registration_peers.py, which compiles it if the library
// is installed (libpcl-dev): `pcl_peer SOURCE.ply TARGET.ply TRUE.ply` prints seconds (including the tree, without file
// access; the library chooses its iterations), and the points' RMS distance from their true positions in metres.
#include <pcl/io/ply_io.h>
#include <pcl/registration/icp.h>

#include <chrono>
#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
  using Cloud = pcl::PointCloud<pcl::PointXYZ>;
  const Cloud::Ptr source(new Cloud), target(new Cloud), truth(new Cloud);
  if (argc != 4 || pcl::io::loadPLYFile(argv[1], *source) < 0 || pcl::io::loadPLYFile(argv[2], *target) < 0 ||
      pcl::io::loadPLYFile(argv[3], *truth) < 0) {
    std::fprintf(stderr, "pcl_peer SOURCE.ply TARGET.ply TRUE.ply\n");
    return 2;
  }
  const auto begin = std::chrono::steady_clock::now();
  pcl::IterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ, double> icp;
  icp.setInputSource(source);
  icp.setInputTarget(target);
  icp.setMaxCorrespondenceDistance(1.0);
  icp.setMaximumIterations(1500);
  icp.setEuclideanFitnessEpsilon(1e-5);
  icp.setTransformationEpsilon(0.0);
  Cloud moved;
  icp.align(moved);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const Eigen::Matrix4d T = icp.getFinalTransformation();
  double sum = 0.0;
  for (std::size_t i = 0; i < source->size(); ++i) {
    const Eigen::Vector4d p((*source)[i].x, (*source)[i].y, (*source)[i].z, 1.0);
    sum += ((T * p).head<3>() - (*truth)[i].getVector3fMap().cast<double>()).squaredNorm();
  }
  std::printf("{\"seconds\": %.3f, \"error_m\": %.4f}\n", seconds,
              std::sqrt(sum / static_cast<double>(source->size())));
  return 0;
}
