#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace brash_ice_rig {

/// Order of the six components in every stress and strain array: xx, yy, zz, xy, yz, zx.
/// Stress in Pa, tension positive. Strain increments are tensor components (shear is half the engineering shear).
constexpr std::size_t kComponents = 6;

/// A run of particles, component by component. All arrays have `count` entries.
struct MaterialBatch {
  std::size_t count = 0;
  std::array<const float*, kComponents> strain_increment{};  ///< of this step, corotational
  std::array<float*, kComponents> stress{};                  ///< in: rotated old stress; out: new stress
  std::vector<float*> state;                                 ///< one array per entry of stateNames(), in place
};

/// A constitutive law. It is stateless itself: state lives in the batch, so that one object serves every thread.
/// Each model passes the property suite of test/material/material_properties_test.cpp.
class Material {
 public:
  virtual ~Material() = default;

  /// Names of the state arrays, for output; each starts at 0 for virgin material. "plastic_strain" is among them.
  virtual std::vector<std::string> stateNames() const = 0;

  /// The last 6 n entries of stateNames() are the components, in the order above, of n symmetric tensors. Like the
  /// stress they come in rotated with the particle.
  virtual std::size_t stateTensors() const { return 0; }

  /// Elastic predictor and return to the yield surface for each particle.
  virtual void update(MaterialBatch& batch) const = 0;

  /// Elastic moduli, Pa: bulk K and shear G (eq. 6).
  virtual double bulkModulus() const = 0;
  virtual double shearModulus() const = 0;

  /// Elastic energy that a particle would give back on unloading, per present volume, J/m³, ≥ 0. Here that of the
  /// moduli above, J1²/(18 K) + J2'/(2 G); a model whose moduli change with its state says so itself.
  /// @param stress_pa  in the order above
  /// @param state      one value per entry of stateNames()
  virtual double elasticEnergyDensity(const std::array<float, kComponents>& stress_pa,
                                      const std::vector<float>& state) const;
};

}  // namespace brash_ice_rig
