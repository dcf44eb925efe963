#pragma once

#include <QSlider>

namespace brash_ice_rig {

/// A slider that is held with the left mouse button and springs back to the middle, 0, as soon as it is let go: also
/// when it is hidden, disabled, or loses the mouse. Goes to where it is pressed. sliderPressed() and sliderReleased()
/// tell when it is held, valueChanged() where. Wheel and keys do nothing, for nobody lets go of a wheel.
class SpringSlider : public QSlider {
 public:
  /// Values on either side of the middle.
  static constexpr int kEnd = 100;

  explicit SpringSlider(Qt::Orientation orientation, QWidget* parent = nullptr);

  /// As if the mouse had let go.
  void letGo();

 protected:
  bool event(QEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;

 private:
  int valueAt(const QPoint& point) const;
};

}  // namespace brash_ice_rig
